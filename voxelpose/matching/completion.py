"""Silhouettes completed where clothes resemble the background of some cameras.

What one camera misses leaves the visual hull, and then the other cameras show something that the
hull does not explain. The missing part is looked for among the pixels of a trimap that may belong
to the silhouette: on the rays of what is unexplained, where all cameras allow it. Where all but one
in four cameras are sure, what may be a shadow in those may belong to it, too.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.components import label_components
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.carving.carver import CarveRule, carve
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.kernels.footprint import mark_voxels

_VOXEL_M = 0.03
_THIN_PX = 5  # narrower pieces are edges


class SilhouetteCompletion:
    """Completes the silhouettes of one frame after the other.

    Args:
        views: the C cameras.
        volume: where the body may be.
        rule: how many cameras may object to a voxel.
    """

    def __init__(self, views: PinholeViews, volume: VoxelGrid, rule: CarveRule):
        """Keeps the settings."""
        self._rig, self._rule = views.rig, rule
        low = volume.origin_m
        self._grid = grid = VoxelGrid.from_bounds(low, low + volume.size_m, _VOXEL_M)
        outvoted = len(views.rig) // 4
        self._majority = replace(rule, tolerance=rule.tolerance + outvoted)
        self._seen_by_one = CarveRule(tolerance=len(views.rig), least_agreeing=1)
        middle = grid.origin_m + 0.5 * grid.size_m
        depth = np.maximum(views.rotation[:, 2] @ middle + views.translation_m[:, 2], 0.1)
        self._voxel_px = views.intrinsics[:, 0] * grid.voxel_size_m / depth

    def complete(
        self,
        masks: list[NDArray[np.bool_]],
        possible: list[NDArray[np.bool_]],
        shaded: list[NDArray[np.bool_]],
    ) -> list[NDArray[np.bool_]]:
        """Silhouettes (h, w) bool of one frame with what was found to be missing, one per camera.

        Args:
            masks: the silhouettes.
            possible: the silhouettes and where clothes may resemble the background, (h, w) bool.
            shaded: that and where clothes or a shadow may be, (h, w) bool.
        """
        hull = carve(self._rig, masks, self._grid, self._rule)
        unexplained = [self._unexplained(mask, hull, c) for c, mask in enumerate(masks)]
        if not any(pixels.any() for pixels in unexplained):
            return masks
        hidden = carve(self._rig, unexplained, self._grid, self._seen_by_one) & ~hull
        allowed = self._carved(possible) & hidden
        agreed = carve(self._rig, masks, self._grid, self._majority) & hidden
        completed = []
        for c, (mask, more, most) in enumerate(zip(masks, possible, shaded, strict=True)):
            added = more & self._footprint(allowed, c) | most & self._footprint(agreed, c)
            completed.append(mask | _opened(added & ~mask))
        return completed

    def _carved(self, masks: list[NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """Hull of silhouettes widened by half a voxel, so that thin limbs remain."""
        wide = [
            _dilated(mask, 2 * round(0.5 * size) + 1)
            for mask, size in zip(masks, self._voxel_px, strict=True)
        ]
        return carve(self._rig, wide, self._grid, self._rule)

    def _unexplained(
        self, mask: NDArray[np.bool_], hull: NDArray[np.bool_], c: int
    ) -> NDArray[np.bool_]:
        """Pixels (h, w) of a silhouette's components that show the hull, and more than it."""
        explained = mask & self._footprint(hull, c)
        if not explained.any():
            return explained
        labels = label_components(mask).labels
        return _opened(np.isin(labels, np.unique(labels[explained])) & ~explained)

    def _footprint(self, hull: NDArray[np.bool_], c: int) -> NDArray[np.bool_]:
        """Pixels (h, w) of a camera into which voxels project, without gaps between them."""
        camera = self._rig.cameras[c]
        marked = np.zeros(camera.size[::-1], np.uint8)
        mark_voxels(hull, *self._grid.axes(), camera.projection, marked)
        return _dilated(marked.view(np.bool_), int(np.ceil(1.5 * self._voxel_px[c])) | 1)


def _dilated(mask: NDArray[np.bool_], side_px: int) -> NDArray[np.bool_]:
    square = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.dilate(mask.view(np.uint8), square), np.uint8).view(np.bool_)


def _opened(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    square = np.ones((_THIN_PX, _THIN_PX), np.uint8)
    opened = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, square)
    return np.asarray(opened, np.uint8).view(np.bool_)
