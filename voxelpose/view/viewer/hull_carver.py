"""Hulls of a result's frames, carved as the fit carved them."""

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class HullCarver:
    """Carves frames and compares their hulls with the fitted body.

    Silhouettes, voxels and rule are those of the multi-view estimator; the volume is that around
    the motion, or around the silhouettes where there is none.

    Attributes:
        views: the cameras.
        rule: which voxels may belong to a body.
        fitted: the body; None where there is none.
    """

    views: PinholeViews
    voxel_size_m: float
    rule: CarveRule
    fitted: FittedBody | None

    def observe(self, masks: list[NDArray[np.bool_]], row: int | None) -> FrameObservation | None:
        """Hull and silhouettes of one body, or None where no hull of a body's size is left.

        Args:
            masks: a silhouette (h, w) bool per camera.
            row: of the motion, whose root tells this body from others; None: the largest body.

        Raises:
            InputError: the silhouettes leave no volume to carve.
        """
        near = None if row is None or self.fitted is None else self.fitted.motion.root_m[row]
        observer = HullObserver(self.views, self._volume(masks), self.voxel_size_m, self.rule)
        return observer.observe(self.views.without_unknown(masks), near)

    def hull(self, observation: FrameObservation, row: int | None) -> CarvedHull:
        """Surface of an observed hull, and the voxels that the body of a row leaves unexplained."""
        grid, occupancy = observation.grid, observation.occupancy
        vertices, faces = surface(*grid.cropped(occupancy))
        unexplained, distance = np.zeros((0, 3)), np.zeros(0)
        if row is not None and self.fitted is not None:
            quality = assess(self.fitted.volume, self.fitted.pose(row), observation)
            unexplained = grid.centres(quality.unexplained_voxels)
            distance = np.asarray(KDTree(self.fitted.points(row)).query(unexplained)[0], float)
        return CarvedHull(grid, occupancy, vertices, faces, unexplained, distance)

    def areas(self, observation: FrameObservation, row: int) -> dict[str, LimbArea]:
        """Movable areas by the name of the limb's first part; the limbs above as in a row's pose.

        Source: Iiyama, Kameda and Minoh, section 3.
        """
        if self.fitted is None:
            return {}
        areas = movable_areas(
            self.fitted.volume, observation.grid, observation.occupancy, self.fitted.pose(row)
        )
        return {area.limb.name: area for area in areas}

    def _volume(self, masks: list[NDArray[np.bool_]]) -> VoxelGrid:
        coarse_m = 2 * self.voxel_size_m
        if self.fitted is None:
            hidden = self.views.unknown
            return place_grid(self.views.rig, masks, coarse_m, rule=self.rule, unknown=hidden)
        root = self.fitted.motion.root_m
        reach_m = 1.3  # of a body from its root: an arm's length above the head
        return VoxelGrid.from_bounds(root.min(0) - reach_m, root.max(0) + reach_m, coarse_m)
