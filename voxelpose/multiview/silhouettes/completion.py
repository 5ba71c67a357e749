"""Silhouettes completed where clothes resemble the background.

What one camera misses leaves the visual hull, and then the other cameras show something that the
hull does not explain. The missing part is looked for among the pixels of a soft silhouette that may
belong to it: on the rays of what is unexplained, where all cameras allow it, or all but one in four
are sure.
"""

from dataclasses import replace

import cv2
import numpy as np

from calib.checks import BoolArray
from silhouette_core.image.cleanup import clean, dilated, opened, pieces_with
from silhouette_core.image.difference import window_radius
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.footprint import mark_voxels
from voxelpose.multiview.carving.observe import widened
from voxelpose.multiview.tuning import CARVING, COMPLETION

Masks = list[BoolArray]
"""A mask (h, w) bool per camera."""

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
        self._views, self._rule = views, rule
        low = volume.origin_m
        self._grid = grid = VoxelGrid.from_bounds(low, low + volume.size_m, CARVING.voxel_m)
        outvoted = len(views.rig) // 4
        self._majority = replace(rule, tolerance=rule.tolerance + outvoted)
        self._seen_by_one = CarveRule(tolerance=len(views.rig), least_agreeing=1)
        middle = grid.origin_m + 0.5 * grid.size_m
        depth = np.maximum(views.rotation[:, 2] @ middle + views.translation_m[:, 2], 0.1)
        self._voxel_px = views.intrinsics[:, 0] * grid.voxel_size_m / depth
        self._radius = [window_radius(camera.size) for camera in views.rig]

    def complete(self, masks: Masks, tint: Masks) -> Masks:
        """Silhouettes (h, w) bool of one frame with what was found to be missing, one per camera.

        Args:
            masks: the silhouettes.
            tint: where the colour's direction differs from the background's, (h, w) bool.
        """
        views = self._views
        hull = carve(views.rig, masks, self._grid, self._rule, views.unknown)
        unexplained = [self._unexplained(mask, hull, c) for c, mask in enumerate(masks)]
        if not any(pixels.any() for pixels in unexplained):
            return masks
        possible = [self._without_holes(masks[c] | tint[c], c) for c in range(len(masks))]
        hidden = carve(views.rig, unexplained, self._grid, self._seen_by_one, views.unknown) & ~hull
        wide = widened(views, possible, self._grid)  # so that thin limbs remain
        allowed = carve(views.rig, wide, self._grid, self._rule, views.unknown) & hidden
        agreed = carve(views.rig, masks, self._grid, self._majority, views.unknown) & hidden
        completed = []
        for c, (mask, more) in enumerate(zip(masks, possible, strict=True)):
            added = more & (self._footprint(allowed, c) | self._footprint(agreed, c))
            completed.append(mask | opened(added & ~mask, _THIN_PX))
        return views.without_unknown(completed)

    def _without_holes(self, mask: BoolArray, c: int) -> BoolArray:
        """Mask (h, w) without narrow gaps and small holes."""
        square = np.ones((4 * self._radius[c] + 1,) * 2, np.uint8)
        closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, square)
        most_px = round(COMPLETION.hole_share * mask.size)
        return clean(np.asarray(closed, np.uint8).view(np.bool_), max_hole_px=most_px)

    def _unexplained(self, mask: BoolArray, hull: BoolArray, c: int) -> BoolArray:
        """Pixels (h, w) of a silhouette's components that show the hull, and more than it."""
        explained = mask & self._footprint(hull, c)
        if not explained.any():
            return explained
        return opened(pieces_with(mask, explained) & ~explained, _THIN_PX)

    def _footprint(self, hull: BoolArray, c: int) -> BoolArray:
        """Pixels (h, w) of a camera into which voxels project, without gaps between them."""
        camera = self._views.rig.cameras[c]
        marked = np.zeros(camera.size[::-1], np.uint8)
        mark_voxels(hull, *self._grid.axes(), camera.projection, marked)
        return dilated(marked.view(np.bool_), int(np.ceil(1.5 * self._voxel_px[c])) | 1)
