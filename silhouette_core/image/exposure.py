"""How much brighter a frame is than a reference, varying smoothly over the picture.

Telephones change exposure, white balance and the tones of parts of the picture while they film.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import ByteArray, Float32Array, FloatArray, RealArray
from silhouette_core.tuning import EXPOSURE

_SIDE_PX = 60  # shorter side of the pictures to which it is fitted
_FEWEST, _ROUNDS = 50, 6  # pixels of a fit, at least, and rounds of reweighting
_BINS = 4096  # of a histogram
_DARK = 4  # grey levels added to both, so that black says little


@dataclass(frozen=True, eq=False)
class Exposure:
    """How a whole frame differs from the background."""

    coefficients: FloatArray  #: (3, 6) float64, of `Aligner`.
    noise: float  #: ratio of the frame's noise to the background's, at least 1.


class Aligner:
    """Gives frames the exposure of a reference (H, W, 3) float32.

    The logarithm of each channel's ratio is a polynomial of second order in the two coordinates,
    fitted to the pixels that agree with it (weights of Geman and McClure).
    """

    def __init__(self, reference: Float32Array) -> None:
        height, width = reference.shape[:2]
        factor = min(1.0, _SIDE_PX / min(height, width))
        self._size = max(round(width * factor), 1), max(round(height * factor), 1)
        self._empty, self._whole = self._small(reference), (width, height)
        rows, columns = np.mgrid[-1 : 1 : self._size[1] * 1j, -1 : 1 : self._size[0] * 1j]
        x, y = columns.ravel(), rows.ravel()
        self._powers = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        # The darker a pixel, the less it says; but a black scene says more than who is lit in it.
        light = np.square(self._empty.min(axis=0) - _DARK)
        self._lit = light / (light + EXPOSURE.dark**2)

    def _small(self, image: NDArray) -> Float32Array:
        """An image (H, W, 3) reduced, channel by channel, (3, N)."""
        small = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA).reshape(-1, 3)
        return small.T.astype(np.float32, order="C") + _DARK

    def aligned(self, frame: ByteArray) -> ByteArray:
        """Frame (H, W, 3) uint8 with the exposure of the reference."""
        return self.applied(frame, self.fitted(frame))

    def fitted(self, frame: ByteArray) -> FloatArray:
        """Coefficients (3, 6) of a frame (H', W', 3) uint8 of any size; 0 where little is lit."""
        lit, powers = self._lit, self._powers
        solution = np.zeros((3, 6))
        if lit.sum() < _FEWEST:
            return solution
        ratios = np.log(self._small(frame) / self._empty)
        solution[:, 0] = [_weighted_median(channel, lit) for channel in ratios]
        held = EXPOSURE.stiffness * lit.sum() * np.diag([0.0, 1, 1, 1, 1, 1])
        for _ in range(_ROUNDS):
            off = np.abs(ratios - solution @ powers).max(axis=0)
            scale = max(2 * 1.4826 * _weighted_median(off, lit), EXPOSURE.least)
            weighted = powers * (lit / np.square(1 + np.square(off / scale)))
            solution = np.linalg.solve(weighted @ powers.T + held, weighted @ ratios.T).T
        return solution

    def shifted(self, frame: ByteArray, before: FloatArray) -> FloatArray:
        """Coefficients of a frame shortly after one that had others: the constants change."""
        solution = before.copy()
        if self._lit.sum() >= _FEWEST:
            off = np.log(self._small(frame) / self._empty) - before @ self._powers
            solution[:, 0] += [_weighted_median(channel, self._lit) for channel in off]
        return solution

    def applied(
        self,
        part: ByteArray,
        coefficients: FloatArray,
        window: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> ByteArray:
        """What of a frame is in a window, (h, w, 3) uint8, with the exposure of the reference."""
        if not coefficients.any():
            return part
        field = np.exp(-coefficients @ self._powers).T.reshape(*self._size[::-1], 3)
        field = cv2.resize(field.astype(np.float32), self._whole, interpolation=cv2.INTER_LINEAR)
        return cv2.multiply(part, field[window], dtype=cv2.CV_8U)  # type: ignore[return-value]


def _weighted_median(values: RealArray, weights: RealArray) -> float:
    """Median of values (N,) of which each counts by its weight."""
    # Only the values near it are sorted.
    low, spread = values.min(), max(float(np.ptp(values)), 1e-9)
    bins = ((values - low) * (_BINS / spread)).astype(np.intp)
    below = np.cumsum(np.bincount(bins, weights))
    half = below[-1] / 2
    middle = np.searchsorted(below, half)
    near = np.flatnonzero(bins == middle)
    order = near[np.argsort(values[near])]
    before = below[middle] - weights[near].sum()
    place = np.searchsorted(before + np.cumsum(weights[order]), half)
    return float(values[order[min(place, len(order) - 1)]])
