"""How much brighter a frame is than a reference, varying smoothly over the picture.

Telephones change exposure, white balance and the tones of parts of the picture while they film.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.tuning import EXPOSURE

_SIDE_PX = 60  # shorter side of the pictures to which it is fitted
_FEWEST, _ROUNDS = 50, 6  # pixels of a fit, at least, and rounds of reweighting
_DARK = 4  # grey levels added to both, so that black says little


def aligned(frame: NDArray[np.uint8], reference: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Frame (H, W, 3) uint8 with the exposure of a reference (H, W, 3) float32.

    The logarithm of each channel's ratio is a polynomial of second order in the two coordinates,
    fitted to the pixels that agree with it (weights of Geman and McClure).
    """
    height, width = reference.shape[:2]
    factor = min(1.0, _SIDE_PX / min(height, width))
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    small, empty = (
        np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32) + _DARK
        for image in (frame, reference)
    )
    rows, columns = np.mgrid[-1 : 1 : size[1] * 1j, -1 : 1 : size[0] * 1j]
    x, y = columns.ravel(), rows.ravel()
    powers = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    ratios = np.log(small / empty).reshape(-1, 3)
    # The darker a pixel, the less it says; but a black scene says more than who is lit in it.
    light = np.square(empty.min(axis=2).ravel() - _DARK)
    lit = light / (light + EXPOSURE.dark**2)
    if lit.sum() < _FEWEST:
        return frame
    solution = np.zeros((6, 3))
    solution[0] = [_weighted_median(channel, lit) for channel in ratios.T]
    held = EXPOSURE.stiffness * lit.sum() * np.diag([0.0, 1, 1, 1, 1, 1])
    for _ in range(_ROUNDS):
        off = np.abs(ratios - powers @ solution).max(axis=1)
        scale = max(2 * 1.4826 * _weighted_median(off, lit), EXPOSURE.least)
        weighted = powers * (lit / (1 + (off / scale) ** 2) ** 2)[:, None]
        solution = np.linalg.solve(weighted.T @ powers + held, weighted.T @ ratios)
    field = np.exp(-powers @ solution).reshape(*size[::-1], 3).astype(np.float32)
    field = cv2.resize(field, (width, height), interpolation=cv2.INTER_LINEAR)
    return cv2.multiply(frame, field, dtype=cv2.CV_8U)  # type: ignore[return-value]


def _weighted_median(values: NDArray[np.floating], weights: NDArray[np.floating]) -> float:
    """Median of values (N,) of which each counts by its weight."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(below, below[-1] / 2)]])
