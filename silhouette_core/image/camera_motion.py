"""Whether a camera stands still, by what is seen at the rim of its picture."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.tuning import CAMERA_MOTION

_SIDE_PX = 640  # of the picture in which motion is measured
_CELLS, _RIM = 10, 2  # of a picture's height and width, and how many of them are the rim
_WINDOW_PX = 5
_CORNERS = 8  # at least, for a median of which most are not a person's


def moves(rims_px: Sequence[float | None]) -> bool:
    """Whether a camera moves, by `rim_motion` at several moments: if most of them tell so."""
    told_px = [moved_px for moved_px in rims_px if moved_px is not None]
    return 2 * len(told_px) > len(rims_px) and float(np.median(told_px)) > CAMERA_MOTION.still_px


def rim_motion(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float | None:
    """How far the rim of a camera's picture moves between two frames.

    Corners at the rim are followed, where people seldom are. Their median displacement is that of
    the scene: a person who passes moves few of them, and noise moves each another way.

    Source: Shi and Tomasi for corners, Lucas and Kanade for following them, both as in OpenCV.

    Args:
        one: frame (H, W, 3) uint8, BGR.
        other: a frame of the same size, a tenth of a second later or earlier.

    Returns:
        Pixels of a picture of 640 px; None where too few corners can be followed.
    """
    first, second = _small_grey(one), _small_grey(other)
    points = _corners(first)
    if len(points) < _CORNERS:
        return None
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, second, points, None)  # type: ignore[call-overload]
    back, again, _ = cv2.calcOpticalFlowPyrLK(second, first, there, None)  # type: ignore[call-overload]
    strayed_px = np.abs(back - points).max(axis=1)
    followed = (found & again).ravel().astype(bool) & (strayed_px < CAMERA_MOTION.still_px)
    if followed.sum() < _CORNERS:
        return None
    moved_px = np.median((there - points)[followed], axis=0)
    return float(np.hypot(*moved_px))


def _corners(grey: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The best corner of every cell at the rim that has one: (n, 2) of (x, y), px."""
    quality = cv2.cornerMinEigenVal(grey, _WINDOW_PX)
    least = max(CAMERA_MOTION.corner, CAMERA_MOTION.over_noise * float(np.median(quality)))
    rows, columns = (np.linspace(0, side, _CELLS + 1).astype(int) for side in grey.shape)
    middle = range(_RIM, _CELLS - _RIM)
    points = []
    for i, j in np.ndindex(_CELLS, _CELLS):
        cell = quality[rows[i] : rows[i + 1], columns[j] : columns[j + 1]]
        if not (i in middle and j in middle) and cell.max(initial=0) > least:
            y, x = np.unravel_index(cell.argmax(), cell.shape)
            points.append((columns[j] + x, rows[i] + y))
    return np.array(points, np.float32).reshape(-1, 2)


def _small_grey(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    scale = _SIDE_PX / max(grey.shape)
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8)
