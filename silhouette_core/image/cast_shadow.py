"""The darkest cast shadow of a recording."""

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.difference import (
    UNIT,
    Background,
    FrameView,
    RefinedSettings,
    detect,
    grown,
    measure_exposure,
    pooled_brightness,
    radius_of,
)
from silhouette_core.image.kernels import foreground as kernels

_CHROMA = 1.0  # noise: largest pooled chromatic residual of what only the light explains
_BRIGHTNESS = 5.0  # noise: least difference of its brightness
_EDGES = np.arange(0.25, 0.96, 0.02)  # of the histogram of brightness ratios
_PIXELS = 150  # fewest that show what shadows are like
_MARGIN = 0.1  # darkest shadow below the peak of the histogram
_CORE = 0.05  # share of the pixels that may be the core of a soft shadow
_CORE_MARGIN = 0.03
_LIMITS = 0.25, 0.5, 0.65  # lowest, usual, highest


def count_shadows(
    frame: NDArray[np.uint8], background: Background, settings: RefinedSettings
) -> NDArray[np.int64]:
    """Histogram of the ratios of a frame's brightness to the background's, where only the
    brightness is lower and the colour's direction is the same: mostly cast shadows.

    Args:
        frame: (H, W, 3) uint8.
        background: of that size.
        settings: thresholds.

    Returns:
        (35,) int64, of ratios from 0.25 to 0.95.
    """
    exposure, radius = measure_exposure(frame, background, settings), radius_of(background)
    view = FrameView.of(frame, background, exposure.gain, radius, settings)
    _, pooled = detect(view, exposure.noise)
    bright = pooled_brightness(view)
    limits = round(_CHROMA * UNIT), np.float32(np.inf)
    coloured = np.empty(bright.shape, np.bool_)
    kernels.doubt(pooled, bright, *limits, coloured)
    dark = ~coloured & (bright < -_BRIGHTNESS * exposure.noise)
    inside = ~grown(~dark, radius, cv2.MORPH_RECT)
    ratio = 1 + bright[inside] / background.scales[2][inside]
    return np.histogram(ratio, _EDGES)[0]


def darkest_shadow(counts: NDArray[np.int64]) -> float | None:
    """Ratio of brightness below which nothing is a cast shadow; None where there are too few.

    Args:
        counts: (35,) sum of what `count_shadows` gives for some frames and cameras.
    """
    if counts.sum() < _PIXELS:
        return None
    middles = 0.5 * (_EDGES[:-1] + _EDGES[1:])
    peak = middles[np.convolve(counts, np.ones(3), "same").argmax()]
    # The penumbra of a soft shadow has the peak, its core is darker.
    core = middles[np.searchsorted(np.cumsum(counts), _CORE * counts.sum())]
    lowest, usual, highest = _LIMITS
    below = peak - _MARGIN
    if below < usual:
        return max(lowest, float(below))
    return float(np.clip(min(below, core - _CORE_MARGIN), usual, highest))
