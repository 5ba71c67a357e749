"""Whether a camera stands still, by what is seen at the rim of its picture, and frames of one that
shakes, registered to one of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from calib.checks import ByteArray, FloatArray
from silhouette_core.tuning import CAMERA_MOTION

_SIDE_PX = 640  # of the picture whose pixels displacements are measured in
_SIDES_PX = 80, 320  # of those in which they are looked for
_RIM = 5  # of a picture's height and width, the part on each side that is the rim
_PIXELS = 8192  # those of the strongest edges
_EDGES = 8  # of pixels that stand out of noise, at least; a rim without them is bare
_EVERY = 7  # of the rim's pixels, by which residuals are judged
_ROUNDS = 20


class CameraMovement:
    """How a camera moves, by some of its frames; its frames, registered to where it mostly is.

    The rim of their median picture, where people seldom are, is looked for in each. A similarity is
    fitted to all its pixels, with weights of Geman and McClure: a person who passes fits nowhere
    and counts little, and noise moves nothing.

    Attributes:
        moves: Whether most frames show another place, or one that is too far away to be found.
        shakes: Whether the rim is found, elsewhere in a quarter of the frames or the empty view.

    Source: Lucas and Kanade (1981), coarse to fine.
    """

    def __init__(self, frames: Sequence[ByteArray], empty: Sequence[ByteArray] = ()) -> None:
        """Looks at frames (H, W, 3) uint8, BGR, of a take, and of its empty view."""
        self._size = frames[0].shape[1::-1]
        self._median = _Rim(np.median([_reduced(one) for one in frames], axis=0).astype(np.uint8))
        found = [self._moved_to(frame) for frame in frames]
        known = [moved for moved in found if moved is not None]
        self.moves, self.shakes = 2 * len(known) < len(found), False
        if self.moves:
            return
        self._to_median = np.linalg.inv(np.mean(known, axis=0))
        away_px = float(np.quantile([self._away_px(moved) for moved in known], 0.75))
        empty_px = max((self._away_px(self._moved_to(frame)) for frame in empty), default=0.0)
        self.shakes = max(away_px, empty_px) > CAMERA_MOTION.still_px

    def registered(self, frame: ByteArray) -> ByteArray:
        """A frame of the same size, moved, turned and scaled so that its rim is where it is in the
        mean; as it is where that cannot be told.
        """
        moved = self._moved_to(frame)
        if moved is None:
            return frame
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        matrix = (moved @ self._to_median)[:2]
        steady = cv2.warpAffine(frame, matrix, self._size, flags=flags, borderMode=border)
        return np.asarray(steady, np.uint8)

    def _away_px(self, moved: FloatArray | None) -> float:
        """How far the picture's corners are from where they are in the mean of all frames: pixels
        of a picture of 640 px.
        """
        if moved is None:
            return np.inf
        corners = np.array([(x, y, 1) for x in (0, self._size[0]) for y in (0, self._size[1])])
        away = corners @ (moved @ self._to_median - np.eye(3)).T
        return float(np.linalg.norm(away, axis=1).mean() * _SIDE_PX / max(self._size))

    def _moved_to(self, frame: ByteArray) -> FloatArray | None:
        """Similarity (3, 3) from the median picture to a frame, px; None unless that from there to
        here is its inverse.
        """
        one, other = self._median, _Rim(_reduced(frame))
        if one.bare or other.bare:
            return np.eye(3)  # nothing moves that can be seen
        there, back = one.fitted(other), other.fitted(one)
        off = np.abs(_matrix(there, 1.0) @ _matrix(back, 1.0) - np.eye(3))
        if not off.max() * _SIDE_PX < CAMERA_MOTION.still_px:
            return None
        about = np.eye(3)
        about[:2, 2] = (np.array(self._size) - 1) / 2
        return about @ _matrix(there, max(self._size)) @ np.linalg.inv(about)


def _reduced(picture: ByteArray, side_px: int = _SIDES_PX[-1]) -> ByteArray:
    """A picture (H, W) or (H, W, 3) uint8 in grey, its longer side at most so long."""
    if picture.ndim == 3:
        picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
    scale = side_px / max(picture.shape)
    if scale < 1:
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        picture = np.asarray(small, np.uint8)
    return picture


class _Rim:
    """The rim of a reduced picture (h, w) uint8, at several sizes."""

    def __init__(self, grey: ByteArray) -> None:
        self._levels = [_Level(_reduced(grey, side_px)) for side_px in _SIDES_PX]
        self.bare = self._levels[-1].bare

    def fitted(self, other: _Rim) -> FloatArray:
        """Similarity to another frame."""
        similarity = np.zeros(4)
        for here, there in zip(self._levels, other._levels, strict=True):
            similarity = here.fitted(there, similarity)
        return similarity


def _matrix(similarity: FloatArray, side: float) -> FloatArray:
    """Matrix (3, 3) of a similarity (shift right and down, turn, growth), whose lengths are in
    longer sides of a picture, about its middle.
    """
    right, down, turn, growth = similarity
    return np.array([[1 + growth, -turn, right * side], [turn, 1 + growth, down * side], [0, 0, 1]])


class _Level:
    """A picture (h, w) uint8, and the strongest edges of its rim."""

    def __init__(self, grey: ByteArray) -> None:
        self.picture = cv2.GaussianBlur(grey.astype(np.float32), (3, 3), 0)
        height, width = grey.shape
        self.side = max(grey.shape)
        rim = np.ones(grey.shape, np.bool_)
        rim[height // _RIM : -(height // _RIM), width // _RIM : -(width // _RIM)] = False
        places = np.flatnonzero(rim)
        self.judged = places[::_EVERY]
        right, down = (
            self.side * cv2.Sobel(self.picture, cv2.CV_32F, *order, scale=1 / 8).ravel()[places]
            for order in ((1, 0), (0, 1))
        )
        edge = np.hypot(right, down)
        kept = np.argpartition(-edge, min(_PIXELS, len(places) - 1))[:_PIXELS]
        strong = edge > CAMERA_MOTION.over_noise * np.median(edge)
        self.bare = np.count_nonzero(strong) < _EDGES
        self.kept, right, down = places[kept], right[kept], down[kept]
        rows, columns = np.divmod(self.kept, width)
        x, y = (columns - (width - 1) / 2) / self.side, (rows - (height - 1) / 2) / self.side
        self.slopes = np.stack([right, down, x * down - y * right, x * right + y * down])

    def fitted(self, other: _Level, similarity: FloatArray) -> FloatArray:
        """A similarity from this picture to another, fitted from a first one on."""
        height, width = self.picture.shape
        middle = np.array([width - 1, height - 1]) / 2
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        here = self.picture.ravel()
        for _ in range(_ROUNDS):
            matrix = _matrix(similarity, self.side)[:2]
            matrix[:, 2] += middle - matrix[:, :2] @ middle
            seen = cv2.warpAffine(
                other.picture, matrix, (width, height), flags=flags, borderMode=border
            )
            off = seen.ravel() - here
            brighter = float(np.median(off[self.judged]))  # exposure
            spread = float(np.median(np.abs(off[self.judged] - brighter)))
            off = off[self.kept] - brighter
            weights = 1 / np.square(1 + np.square(off / max(2 * 1.4826 * spread, 1.0)))
            weighted = self.slopes * weights
            normal = weighted @ self.slopes.T
            step = np.linalg.solve(normal + np.eye(4), -weighted @ off)
            similarity = similarity + step
            if np.abs(step).max() * _SIDE_PX < 0.05:
                break
        return similarity
