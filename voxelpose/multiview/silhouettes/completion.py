"""Silhouettes completed where clothes resemble the background.

What one camera misses leaves the visual hull, and then the other cameras show something that the
hull does not explain. The missing part is looked for among the pixels of a soft silhouette that may
belong to it: on the rays of what is unexplained, where all cameras allow it. Where all but one
in four cameras are sure, what has the person's colours in those may belong to it, too, once these
are known.

What all cameras miss is found where all of them show a piece whose tint differs from the background
nearly everywhere, if only by a little.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.components import label_components
from silhouette_core.image.cleanup import clean, dilated
from silhouette_core.image.difference import window_radius
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.footprint import mark_voxels
from voxelpose.multiview.carving.observe import widened
from voxelpose.multiview.tuning import COMPLETION

Masks = list[NDArray[np.bool_]]
"""A mask (h, w) bool per camera."""

_THIN_PX = 5  # narrower pieces are edges
_PIECE_PX = 30  # a camera that shows less of a piece does not judge it


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
        self._grid = grid = VoxelGrid.from_bounds(low, low + volume.size_m, COMPLETION.voxel_m)
        outvoted = len(views.rig) // 4
        self._majority = replace(rule, tolerance=rule.tolerance + outvoted)
        self._seen_by_one = CarveRule(tolerance=len(views.rig), least_agreeing=1)
        middle = grid.origin_m + 0.5 * grid.size_m
        depth = np.maximum(views.rotation[:, 2] @ middle + views.translation_m[:, 2], 0.1)
        self._voxel_px = views.intrinsics[:, 0] * grid.voxel_size_m / depth
        self._radius = [window_radius(camera.size) for camera in views.rig]

    def complete(self, masks: Masks, tint: Masks, alike: Masks | None = None) -> Masks:
        """Silhouettes (h, w) bool of one frame with what was found to be missing, one per camera.

        Args:
            masks: the silhouettes.
            tint: where the colour's direction differs from the background's, (h, w) bool.
            alike: where a pixel has a colour of the person's, (h, w) bool; None: not known.
        """
        masks = self._seen_by_some(masks, tint, alike or tint)
        return self._views.without_unknown(self._missed_by_all(masks, tint))

    def unexplained(self, masks: Masks) -> float:
        """Share of the silhouettes' pixels that their hull does not explain, a mean of the cameras:
        other cameras miss what these show.
        """
        hull = carve(self._views.rig, masks, self._grid, self._rule, self._views.unknown)
        return float(
            np.mean(
                [
                    np.count_nonzero(self._unexplained(mask, hull, c))
                    / max(np.count_nonzero(mask), 1)
                    for c, mask in enumerate(masks)
                ]
            )
        )

    def _seen_by_some(self, masks: Masks, tint: Masks, alike: Masks) -> Masks:
        unknown = self._views.unknown
        hull = carve(self._views.rig, masks, self._grid, self._rule, unknown)
        unexplained = [self._unexplained(mask, hull, c) for c, mask in enumerate(masks)]
        if not any(pixels.any() for pixels in unexplained):
            return masks
        possible = [self._without_holes(masks[c] | tint[c], c) for c in range(len(masks))]
        anything = [
            self._without_holes(masks[c] | tint[c] | alike[c], c) for c in range(len(masks))
        ]
        hidden = carve(self._views.rig, unexplained, self._grid, self._seen_by_one, unknown) & ~hull
        allowed = self._carved(possible) & hidden
        agreed = carve(self._views.rig, masks, self._grid, self._majority, unknown) & hidden
        completed = []
        for c, (mask, more, most) in enumerate(zip(masks, possible, anything, strict=True)):
            added = more & self._footprint(allowed, c) | most & self._footprint(agreed, c)
            completed.append(mask | _opened(added & ~mask))
        return completed

    def _missed_by_all(self, masks: Masks, tint: Masks) -> Masks:
        differs = [mask | colour for mask, colour in zip(masks, tint, strict=True)]
        hull = self._carved(masks)
        if not hull.any() or all(map(np.array_equal, differs, masks)):
            return masks
        likely = [_closed(found, 2 * r + 1) for found, r in zip(differs, self._radius, strict=True)]
        kept = np.zeros_like(hull)
        for piece in self._pieces(hull, self._carved(likely) & ~hull):
            if self._differs(piece, masks, differs):
                kept |= piece
        if not kept.any():
            return masks
        return [
            mask | _opened(more & self._footprint(kept, c) & ~mask)
            for c, (mask, more) in enumerate(zip(masks, likely, strict=True))
        ]

    def _pieces(self, hull: NDArray[np.bool_], more: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
        """Large pieces (nx, ny, nz) bool of additional voxels that touch the hull's largest one."""
        voxel_m3 = self._grid.voxel_size_m**3
        if more.sum() * voxel_m3 < COMPLETION.piece_m3:
            return []
        joined = label_components(hull | more, diagonal=False).labels
        more = more & (joined == np.bincount(joined[hull]).argmax())
        pieces = label_components(more, diagonal=False)
        most = COMPLETION.most_added * np.count_nonzero(hull)
        large = np.flatnonzero(
            (pieces.sizes * voxel_m3 >= COMPLETION.piece_m3) & (pieces.sizes <= most)
        )
        return [pieces.labels == k for k in large]

    def _differs(self, piece: NDArray[np.bool_], masks: Masks, differs: Masks) -> bool:
        """Whether a piece differs from the background at most of its pixels."""
        shares = []
        for c, (mask, found) in enumerate(zip(masks, differs, strict=True)):
            edge = int(np.ceil(1.5 * self._voxel_px[c])) | 1
            inside = ~dilated(~self._footprint(piece, c), edge)
            inside &= ~dilated(mask, 2 * self._radius[c] + 1)
            if self._views.unknown is not None:
                inside &= ~self._views.unknown[c]
            if (pixels := np.count_nonzero(inside)) > _PIECE_PX:
                shares.append(np.count_nonzero(found & inside) / pixels)
        if not shares:
            return False
        mostly = bool(np.mean(shares) >= COMPLETION.piece_share)
        return mostly and min(shares) >= 1 - COMPLETION.piece_share

    def _without_holes(self, mask: NDArray[np.bool_], c: int) -> NDArray[np.bool_]:
        """Mask (h, w) without narrow gaps and small holes."""
        closed = _closed(mask, 4 * self._radius[c] + 1)
        return clean(closed, max_hole_px=round(COMPLETION.hole_share * mask.size))

    def _carved(self, masks: Masks) -> NDArray[np.bool_]:
        """Hull of silhouettes widened by half a voxel, so that thin limbs remain."""
        wide = widened(self._views, masks, self._grid)
        return carve(self._views.rig, wide, self._grid, self._rule, self._views.unknown)

    def _unexplained(
        self, mask: NDArray[np.bool_], hull: NDArray[np.bool_], c: int
    ) -> NDArray[np.bool_]:
        """Pixels (h, w) of a silhouette's components that show the hull, and more than it."""
        explained = mask & self._footprint(hull, c)
        if not explained.any():
            return explained
        components = label_components(mask)
        shows = np.zeros(len(components.sizes), np.bool_)
        shows[components.labels[explained]] = True
        return _opened(shows[components.labels] & ~explained)

    def _footprint(self, hull: NDArray[np.bool_], c: int) -> NDArray[np.bool_]:
        """Pixels (h, w) of a camera into which voxels project, without gaps between them."""
        camera = self._views.rig.cameras[c]
        marked = np.zeros(camera.size[::-1], np.uint8)
        mark_voxels(hull, *self._grid.axes(), camera.projection, marked)
        return dilated(marked.view(np.bool_), int(np.ceil(1.5 * self._voxel_px[c])) | 1)


def _closed(mask: NDArray[np.bool_], side_px: int) -> NDArray[np.bool_]:
    square = np.ones((side_px, side_px), np.uint8)
    closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, square)
    return np.asarray(closed, np.uint8).view(np.bool_)


def _opened(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    square = np.ones((_THIN_PX, _THIN_PX), np.uint8)
    opened = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, square)
    return np.asarray(opened, np.uint8).view(np.bool_)
