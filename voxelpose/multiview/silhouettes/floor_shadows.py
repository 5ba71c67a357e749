"""What may be a shadow on the floor, by what several cameras see of the floor."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.image.cleanup import dilated
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.tuning import FLOOR_SHADOWS

_EDGE_PX = 7  # by which what is dark is widened
_UNSEEN = 2

Mask = NDArray[np.bool_]
Masks = list[Mask]
"""A mask (h, w) bool per camera."""


class FloorShadows:
    """Tells what may be a shadow on the floor.

    Args:
        rig: the C pinhole cameras.
        floor_m: height of the floor.
        unknown: as of `PinholeViews`.
    """

    def __init__(self, rig: Rig, floor_m: float = 0.0, unknown: Sequence[Mask] | None = None):
        """Prepares the homographies between floor and images."""
        lift = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, floor_m], [0, 0, 1]])
        self._rig, self._unknown = rig, unknown
        self._from_floor = [camera.projection @ lift for camera in rig]
        self._above_m = [float(camera.center_m[2]) - floor_m for camera in rig]

    def possible(self, dark: Masks, person_m: NDArray[np.float64]) -> Masks:
        """Dark pixels (h, w) bool of each camera that may be a shadow on the floor.

        All other cameras that see that place of the floor see it dark, or hidden by the person;
        what none of them sees is near the person.

        Args:
            dark: where each camera sees the person, or something that may be a shadow.
            person_m: (2,) place of the person on the floor.
        """
        wide = [dilated(mask, _EDGE_PX).view(np.uint8) for mask in dark]
        if self._unknown is not None:
            seen = zip(wide, self._unknown, strict=True)
            wide = [np.where(where, np.uint8(_UNSEEN), mask) for mask, where in seen]
        return [self._possible(c, mask.copy(), wide, person_m) for c, mask in enumerate(dark)]

    def _possible(
        self,
        c: int,
        allowed: NDArray[np.bool_],
        wide: list[NDArray[np.uint8]],
        person_m: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Of the pixels (h, w) bool of a camera that are dark, those that may be a shadow."""
        unseen = np.ones_like(allowed)
        if abs(self._above_m[c]) < 1e-3:  # it sees the floor as a line
            return ~unseen
        to_floor = np.linalg.inv(self._from_floor[c])
        for other, mask in enumerate(wide):
            if other == c:
                continue
            seen = cv2.warpPerspective(
                mask,
                self._from_floor[other] @ to_floor,
                allowed.shape[::-1],
                flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=_UNSEEN,
            )
            allowed &= seen != 0
            unseen &= seen == _UNSEEN
        y, x = np.nonzero(allowed)
        floor_x, floor_y, scale = to_floor @ np.stack([x, y, np.ones_like(x)])
        # Compared without a division: the scale is negative above the horizon.
        across, along = floor_x - person_m[0] * scale, floor_y - person_m[1] * scale
        near = across**2 + along**2 < (FLOOR_SHADOWS.longest_m * scale) ** 2
        allowed[y, x] = (scale > 0) & (near | ~unseen[y, x])
        return allowed


def floor_under(observer: HullObserver, frames: Sequence[Masks]) -> float:
    """Height of the floor in m: 0, or that of the lowest points of the hulls of some frames.

    Args:
        observer: of the hulls.
        frames: silhouettes (h, w) bool per camera, of each frame.
    """
    lowest = []
    for masks in frames:
        hulls = observer.components(masks)
        body = observer.body(hulls, None)
        most_m3 = np.inf if body is None else hulls.volume_m3[body]
        # Feet may be all that is left of the legs; what is larger than the body is an object, and
        # the hull of a board on the floor ends below it.
        pieces = (hulls.volume_m3 >= FLOOR_SHADOWS.foot_m3) & (hulls.volume_m3 <= most_m3)
        if pieces.any():
            lowest.append(hulls.bounds_m[pieces, 0, 2].min())
    height = float(np.quantile(lowest, 0.2)) if lowest else 0.0
    return height if abs(height) > FLOOR_SHADOWS.floor_m else 0.0
