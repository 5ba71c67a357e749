"""Hulls of a result's frames, carved as the fit carved them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from silhouette_core.refinement.observation import PinholeViews
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import surface
from voxelpose.multiview.carving.observe import FrameObservation, HullObserver
from voxelpose.multiview.matching.matcher import LimbArea, movable_areas
from voxelpose.multiview.quality.quality import assess
from voxelpose.view.viewer.fitted_body import FittedBody
from voxelpose.view.viewer.scene import CarvedHull

_REACH_M = 1.3  # of a body from its root: an arm's length above the head


class HullCarver:
    """Carves frames and compares their hulls with the fitted body.

    Silhouettes, voxels and rule are those of the multi-view estimator; the volume is that around
    the motion, or around the silhouettes where there is none.
    """

    def __init__(
        self, views: PinholeViews, voxel_size_m: float, rule: CarveRule, fitted: FittedBody | None
    ) -> None:
        """Prepares.

        Args:
            views: the cameras.
            voxel_size_m: of the hull.
            rule: which voxels may belong to a body.
            fitted: the body; None where there is none.
        """
        self._views = views
        self._voxel_size_m = voxel_size_m
        self._rule = rule
        self._fitted = fitted

    def observe(self, masks: list[NDArray[np.bool_]], row: int | None) -> FrameObservation | None:
        """Hull and silhouettes of one body, or None where no hull of a body's size is left.

        Args:
            masks: a silhouette (h, w) bool per camera.
            row: of the motion, whose root tells this body from others; None: the largest body.

        Raises:
            InputError: the silhouettes leave no volume to carve.
        """
        near = None if row is None or self._fitted is None else self._fitted.motion.root_m[row]
        observer = HullObserver(self._views, self._volume(masks), self._voxel_size_m, self._rule)
        return observer.observe(self._views.without_unknown(masks), near)

    def hull(self, observation: FrameObservation, row: int | None) -> CarvedHull:
        """Surface of an observed hull, and the voxels that the body of a row leaves unexplained."""
        grid, occupancy = observation.grid, observation.occupancy
        vertices, faces = surface(*grid.cropped(occupancy))
        unexplained, distance = np.zeros((0, 3)), np.zeros(0)
        if row is not None and self._fitted is not None:
            quality = assess(self._fitted.volume, self._fitted.pose(row), observation)
            unexplained = grid.centres(quality.unexplained_voxels)
            distance = np.asarray(KDTree(self._fitted.points(row)).query(unexplained)[0], float)
        return CarvedHull(grid, occupancy, vertices, faces, unexplained, distance)

    def areas(self, observation: FrameObservation, row: int) -> dict[str, LimbArea]:
        """Movable areas by the name of the limb's first part; the limbs above as in a row's pose.

        Source: Iiyama, Kameda and Minoh, section 3.
        """
        if self._fitted is None:
            return {}
        areas = movable_areas(
            self._fitted.volume, observation.grid, observation.occupancy, self._fitted.pose(row)
        )
        return {area.limb.name: area for area in areas}

    def _volume(self, masks: list[NDArray[np.bool_]]) -> VoxelGrid:
        coarse_m = 2 * self._voxel_size_m
        if self._fitted is None:
            hidden = self._views.unknown
            return place_grid(self._views.rig, masks, coarse_m, rule=self._rule, unknown=hidden)
        root = self._fitted.motion.root_m
        return VoxelGrid.from_bounds(root.min(0) - _REACH_M, root.max(0) + _REACH_M, coarse_m)
