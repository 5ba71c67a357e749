"""The darkest cast shadow of a recording."""

from dataclasses import replace

import numpy as np

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from silhouette_core.image.cleanup import dilated
from silhouette_core.image.difference import (
    Background,
    FrameView,
    noise_scale,
    pooled_brightness,
    pooled_chroma,
)
from silhouette_core.image.grey import texture_evidence
from silhouette_core.tuning import CUT, FOREGROUND, SHADOW

_PIXELS = 150  # fewest that show what shadows are like
_SHADES = 50  # bins of a ratio of brightness


def _edges() -> FloatArray:
    """Edges (36,) of the histogram of brightness ratios."""
    return np.arange(SHADOW.range[0], 0.96, 0.02)


def count_shadows(frame: ByteArray, background: Background) -> IntArray:
    """Histogram of the ratios of a frame's brightness to the background's, where only the
    brightness is lower and the colour's direction is the same: mostly cast shadows.

    Args:
        frame: (H, W, 3) uint8, with the exposure of the background.
        background: of that size.

    Returns:
        (35,) int64, of ratios from 0.25 to 0.95.
    """
    view = FrameView.of(frame, background)
    noise, bright = noise_scale(view), pooled_brightness(view)
    dark = only_darker(view, bright, noise)
    if background.grey:
        any_shadow = replace(background, shadow=SHADOW.range[0], several=False)
        dark &= texture_evidence(replace(view, background=any_shadow)) < 0
    inside = ~dilated(~dark, 2 * background.radius + 1)
    ratio = 1 + bright[inside] / background.scales[2][inside]
    return np.histogram(ratio, _edges())[0]


def only_darker(view: FrameView, bright: Float32Array, noise: float) -> BoolArray:
    """Where only the brightness is lower, (H, W) bool: mostly cast shadows.

    Args:
        view: of the frame.
        bright: (H, W), of `pooled_brightness`.
        noise: ratio of the frame's noise to the model's.
    """
    return (pooled_chroma(view, noise) <= SHADOW.chroma) & (bright < -SHADOW.brightness * noise)


def rising_shades(darkest: float) -> Float32Array:
    """Density (50,) of the background's brightness in a shadow, relative to its own: the darker,
    the rarer; its integral is how often there is a shadow.
    """
    shades = (np.arange(_SHADES) + 0.5) / _SHADES
    depth = np.clip(shades - darkest, 0, None) / (1 - darkest)
    return (CUT.shaded * 2 * depth / (1 - darkest)).astype(np.float32)


def darkest_shadow(counts: IntArray) -> float | None:
    """Ratio of brightness below which nothing is a cast shadow; None where there are too few.

    Args:
        counts: (35,) sum of what `count_shadows` gives for some frames and cameras.
    """
    if counts.sum() < _PIXELS:
        return None
    edges = _edges()
    middles = 0.5 * (edges[:-1] + edges[1:])
    peak = middles[np.convolve(counts, np.ones(3), "same").argmax()]
    # The penumbra of a soft shadow has the peak, its core is darker.
    core = middles[np.searchsorted(np.cumsum(counts), SHADOW.core * counts.sum())]
    usual, below = FOREGROUND.shadow, peak - SHADOW.margin
    if below < usual:
        return max(SHADOW.range[0], float(below))
    return float(np.clip(min(below, core - SHADOW.core_margin), usual, SHADOW.range[1]))
