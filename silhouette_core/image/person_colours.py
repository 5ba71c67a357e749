"""Colours of a person, learned from silhouettes.

Background subtraction asks whether a pixel differs from the background; where clothes resemble the
wall, or a shadow on it, that says little. What the person looks like at other moments tells more.
Source: own; colour histograms after Jones and Rehg, Statistical color models with application to
skin detection (2002).
"""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from calib.checks import BoolArray, ByteArray, Float32Array
from silhouette_core.image.cast_shadow import texture_evidence
from silhouette_core.image.difference import Background, FrameView
from silhouette_core.tuning import COLOURS

SHIFT, _BINS = 3, 32  # histograms of 32 x 32 x 32 colours
EVEN = np.full((_BINS, _BINS, _BINS), 1 / 256**3, np.float32)  #: Density when all are alike.
_EDGE_PX = 5  # side of the window within which pixels near the edge are left out


class PersonColours:
    """Histogram of the colours of a person in the pictures of all cameras."""

    def __init__(self, even: Float32Array = EVEN) -> None:
        """Starts without any picture; `even` is the density when all colours are alike."""
        self._counts, self._even = np.zeros(EVEN.shape, np.float32), even.astype(np.float64)

    def add(self, picture: ByteArray, mask: BoolArray) -> None:
        """Adds the pixels of a picture (h, w, 3) uint8, BGR, within a silhouette (h, w) bool but
        for those at its edge.
        """
        window = np.ones((_EDGE_PX, _EDGE_PX), np.uint8)
        inside = cv2.erode(mask.view(np.uint8), window)
        self._counts += cv2.calcHist([picture], (0, 1, 2), inside, EVEN.shape, (0, 256) * 3)

    def density(self) -> Float32Array | None:
        """Log density (32, 32, 32) of the colours so far, each of 256; None before any pixel."""
        counts = self._counts.astype(np.float64)
        total = counts.sum()
        if not total:
            return None
        smooth = gaussian_filter(counts / total, COLOURS.smoothing_bins) * _BINS**3 * EVEN.flat[0]
        density = (1 - COLOURS.any_share) * smooth + COLOURS.any_share * self._even
        return np.log(density).astype(np.float32)

    def least(self, density: Float32Array) -> float:
        """Logarithm of the density above which 95 % of the pixels so far lie."""
        order = np.argsort(-density, axis=None, kind="stable")
        share = np.cumsum(self._counts.astype(np.float64).ravel()[order]) / self._counts.sum()
        last = order[min(int(np.searchsorted(share, COLOURS.own_share)), len(order) - 1)]
        return float(density.ravel()[last])


def even_colours(background: Background) -> Float32Array:
    """Density (32, 32, 32) of colours when all that a camera may show are alike."""
    if not background.grey:
        return EVEN
    greys = np.zeros(EVEN.shape)
    greys[np.diag_indices(_BINS, 3)] = _BINS**2
    return np.maximum(EVEN * gaussian_filter(greys, COLOURS.smoothing_bins), EVEN).astype(
        np.float32
    )


def without_tint(view: FrameView) -> tuple[Float32Array, np.float32]:
    """Of a camera without colour: `texture_evidence` (H, W), and the variance of a grey's colours
    across the grey axis, as histograms spread it; nothing of other cameras.
    """
    if not view.background.grey:
        return np.zeros(view.frame.shape[:2], np.float32), np.float32(0)
    width = 1 << SHIFT
    return texture_evidence(view), np.float32(width**2 * (COLOURS.smoothing_bins**2 + 1 / 12))
