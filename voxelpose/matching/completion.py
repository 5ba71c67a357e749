"""Silhouettes completed where clothes resemble the background.

What one camera misses leaves the visual hull, and then the other cameras show something that the
hull does not explain. The missing part is looked for among the pixels of a soft silhouette that may
belong to it: on the rays of what is unexplained, where all cameras allow it. Where all but one
in four cameras are sure, what may be a shadow in those may belong to it, too.

What all cameras miss is found where all of them show a piece whose pixels differ from the
background nearly everywhere, if only by a little. A difference of brightness counts where it cannot
be a shadow on the floor: some other camera sees that place of the floor lit.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.components import label_components
from silhouette_core.image.cleanup import clean
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.carving.carver import CarveRule, carve
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.kernels.footprint import mark_voxels
from voxelpose.matching.observe import HullObserver

_VOXEL_M = 0.03
_THIN_PX = 5  # narrower pieces are edges
_HOLE_SHARE = 2e-3  # of the image: holes in what may belong to a silhouette
_PIECE_M3 = 0.001  # smaller pieces are noise: a forearm has a litre, a thigh eight
_PIECE_SHARE, _CAMERA_SHARE = 0.6, 0.4  # of a piece's pixels that differ: mean, least camera
_MOST_ADDED = 1.5  # of the hull: a larger piece is no part of a person
_PIECE_PX = 30  # a camera that shows less of a piece does not judge it

_SHADOW_M = 3.0  # longest shadow that is expected where no other camera sees it
_SHADOW_EDGE_PX = 7
_UNSEEN = 2
_FOOT_M3 = 0.0005
_FLOOR_M = 0.15  # a floor no farther from the world's origin than this is there

Masks = list[NDArray[np.bool_]]


class SilhouetteCompletion:
    """Completes the silhouettes of one frame after the other.

    Args:
        views: the C cameras.
        volume: where the body may be.
        rule: how many cameras may object to a voxel.
        floor_m: height of the floor on which shadows fall.

    Attributes:
        rig: the cameras.
    """

    def __init__(
        self, views: PinholeViews, volume: VoxelGrid, rule: CarveRule, floor_m: float = 0.0
    ):
        """Keeps the settings."""
        self.rig, self._rule = views.rig, rule
        low = volume.origin_m
        self._grid = grid = VoxelGrid.from_bounds(low, low + volume.size_m, _VOXEL_M)
        outvoted = len(views.rig) // 4
        self._majority = replace(rule, tolerance=rule.tolerance + outvoted)
        self._seen_by_one = CarveRule(tolerance=len(views.rig), least_agreeing=1)
        middle = grid.origin_m + 0.5 * grid.size_m
        depth = np.maximum(views.rotation[:, 2] @ middle + views.translation_m[:, 2], 0.1)
        self._voxel_px = views.intrinsics[:, 0] * grid.voxel_size_m / depth
        self._radius = [max(1, round(min(camera.size) / 240)) for camera in views.rig]
        # Floor (x, y, 1) to pixel.
        lift = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, floor_m], [0, 0, 1]])
        self._from_floor = [camera.projection @ lift for camera in views.rig]

    def complete(self, masks: Masks, tint: Masks, brightness: Masks) -> Masks:
        """Silhouettes (h, w) bool of one frame with what was found to be missing, one per camera.

        Args:
            masks: the silhouettes.
            tint: where the colour's direction differs from the background's, (h, w) bool.
            brightness: where the brightness differs, (h, w) bool.
        """
        masks = self._seen_by_some(masks, tint, brightness)
        return self._missed_by_all(masks, tint, brightness)

    def _seen_by_some(self, masks: Masks, tint: Masks, brightness: Masks) -> Masks:
        hull = carve(self.rig, masks, self._grid, self._rule)
        unexplained = [self._unexplained(mask, hull, c) for c, mask in enumerate(masks)]
        if not any(pixels.any() for pixels in unexplained):
            return masks
        possible = [self._without_holes(masks[c] | tint[c], c) for c in range(len(masks))]
        shaded = [
            self._without_holes(masks[c] | tint[c] | brightness[c], c) for c in range(len(masks))
        ]
        hidden = carve(self.rig, unexplained, self._grid, self._seen_by_one) & ~hull
        allowed = self._carved(possible) & hidden
        agreed = carve(self.rig, masks, self._grid, self._majority) & hidden
        completed = []
        for c, (mask, more, most) in enumerate(zip(masks, possible, shaded, strict=True)):
            added = more & self._footprint(allowed, c) | most & self._footprint(agreed, c)
            completed.append(mask | _opened(added & ~mask))
        return completed

    def _missed_by_all(self, masks: Masks, tint: Masks, brightness: Masks) -> Masks:
        differs = [a | b | c for a, b, c in zip(masks, tint, brightness, strict=True)]
        hull = self._carved(masks)
        shadow = self._floor_shadows(differs, hull)
        differs = [
            mask | colour | _opened(bright & ~dark)
            for mask, colour, bright, dark in zip(masks, tint, brightness, shadow, strict=True)
        ]
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

    def _floor_shadows(self, dark: Masks, hull: NDArray[np.bool_]) -> Masks:
        """Pixels (h, w) of each camera that may be a shadow on the floor: all other cameras that
        see that place of the floor see it dark, or hidden; what none sees is near the hull.
        """
        columns = np.argwhere(hull.any(axis=2)) if hull.any() else np.zeros((1, 2))
        center = self._grid.origin_m[:2] + columns.mean(axis=0) * self._grid.voxel_size_m
        wide = [_dilated(mask, _SHADOW_EDGE_PX).view(np.uint8) for mask in dark]
        shadows = []
        for camera, to_pixel in zip(self.rig, self._from_floor, strict=True):
            width, height = camera.size
            to_floor = np.linalg.inv(to_pixel)
            allowed, unseen = (np.ones((height, width), np.bool_) for _ in range(2))
            for other, mask in zip(self._from_floor, wide, strict=True):
                if other is to_pixel:
                    continue
                seen = cv2.warpPerspective(
                    mask,
                    other @ to_floor,
                    (width, height),
                    flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
                    borderMode=cv2.BORDER_CONSTANT,
                    borderValue=_UNSEEN,
                )
                allowed &= seen != 0
                unseen &= seen == _UNSEEN
            x, y = np.arange(width), np.arange(height)[:, None]
            floor_x, floor_y, scale = (row[0] * x + row[1] * y + row[2] for row in to_floor)
            # Compared without a division: the scale is negative above the horizon.
            across, along = floor_x - center[0] * scale, floor_y - center[1] * scale
            near = across**2 + along**2 < (_SHADOW_M * scale) ** 2
            shadows.append(allowed & (scale > 0) & (near | ~unseen))
        return shadows

    def _pieces(self, hull: NDArray[np.bool_], more: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
        """Large pieces (nx, ny, nz) bool of additional voxels that touch the hull's largest one."""
        voxel_m3 = self._grid.voxel_size_m**3
        if more.sum() * voxel_m3 < _PIECE_M3 or not hull.any():
            return []
        joined = label_components(hull | more, diagonal=False).labels
        more = more & (joined == np.bincount(joined[hull]).argmax())
        pieces = label_components(more, diagonal=False)
        most = _MOST_ADDED * np.count_nonzero(hull)
        large = np.flatnonzero((pieces.sizes * voxel_m3 >= _PIECE_M3) & (pieces.sizes <= most))
        return [pieces.labels == k for k in large]

    def _differs(self, piece: NDArray[np.bool_], masks: Masks, differs: Masks) -> bool:
        """Whether a piece differs from the background at most of its pixels."""
        shares = []
        for c, (mask, found) in enumerate(zip(masks, differs, strict=True)):
            edge = int(np.ceil(1.5 * self._voxel_px[c])) | 1
            inside = ~_dilated(~self._footprint(piece, c), edge)
            inside &= ~_dilated(mask, 2 * self._radius[c] + 1)
            if (pixels := np.count_nonzero(inside)) > _PIECE_PX:
                shares.append(np.count_nonzero(found & inside) / pixels)
        if not shares:
            return False
        return min(shares) >= _CAMERA_SHARE and bool(np.mean(shares) >= _PIECE_SHARE)

    def _without_holes(self, mask: NDArray[np.bool_], c: int) -> NDArray[np.bool_]:
        """Mask (h, w) without narrow gaps and small holes."""
        closed = _closed(mask, 4 * self._radius[c] + 1)
        return clean(closed, max_hole_px=round(_HOLE_SHARE * mask.size))

    def _carved(self, masks: Masks) -> NDArray[np.bool_]:
        """Hull of silhouettes widened by half a voxel, so that thin limbs remain."""
        wide = [
            _dilated(mask, 2 * round(0.5 * size) + 1)
            for mask, size in zip(masks, self._voxel_px, strict=True)
        ]
        return carve(self.rig, wide, self._grid, self._rule)

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
        camera = self.rig.cameras[c]
        marked = np.zeros(camera.size[::-1], np.uint8)
        mark_voxels(hull, *self._grid.axes(), camera.projection, marked)
        return _dilated(marked.view(np.bool_), int(np.ceil(1.5 * self._voxel_px[c])) | 1)


def floor_under(observer: HullObserver, frames: Sequence[Masks]) -> float:
    """Height of the floor in m: 0, or that of the lowest points of the hulls of some frames.

    Args:
        observer: of the hulls.
        frames: silhouettes (h, w) bool per camera, of each frame.
    """
    lowest = []
    for masks in frames:
        hulls = observer.components(masks)
        # Feet may be all that is left of the legs.
        if (pieces := hulls.volume_m3 >= _FOOT_M3).any():
            lowest.append(hulls.bounds_m[pieces, 0, 2].min())
    height = float(np.quantile(lowest, 0.2)) if lowest else 0.0
    return height if abs(height) > _FLOOR_M else 0.0


def _dilated(mask: NDArray[np.bool_], side_px: int) -> NDArray[np.bool_]:
    square = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.dilate(mask.view(np.uint8), square), np.uint8).view(np.bool_)


def _closed(mask: NDArray[np.bool_], side_px: int) -> NDArray[np.bool_]:
    square = np.ones((side_px, side_px), np.uint8)
    closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, square)
    return np.asarray(closed, np.uint8).view(np.bool_)


def _opened(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    square = np.ones((_THIN_PX, _THIN_PX), np.uint8)
    opened = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, square)
    return np.asarray(opened, np.uint8).view(np.bool_)
