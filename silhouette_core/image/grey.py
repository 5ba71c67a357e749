"""Pictures without colour, of grey and infra-red cameras: texture tells shadows instead of tint.

A shadow is evenly darker than what it falls on, whose texture it keeps; clothes have folds and a
shading of their own. Source: own; shadows by ratios of brightness after Rosin and Ellis, Image
difference threshold strategies and shadow detection (1995).
"""

import cv2
import numpy as np

from calib.checks import ByteArray, Float32Array, RealArray
from silhouette_core.image.cleanup import dilated
from silhouette_core.image.difference import FrameView
from silhouette_core.tuning import CUT, SHADOW

_LEVELS = 4  # grey levels between the channels of a picture without colour, at most
_STEP = 4  # px between the pixels that are asked
_WINDOW = 6  # half of the window of a texture, over that of the pooled evidence
_FREEDOM = 4  # degrees of freedom of a texture within the window, as its spread on walk4 has


def is_grey(image: ByteArray | Float32Array) -> bool:
    """Whether an image (H, W, 3), of 255, has no colour, but for a thousandth of its pixels."""
    spread = np.ptp(image[::_STEP, ::_STEP], axis=2)
    return float(np.quantile(spread, 0.999)) <= _LEVELS


def texture_evidence(view: FrameView) -> Float32Array:
    """What the texture of places that are as dark as a shadow says against one, (H, W) float32:
    twice the logarithm of a ratio of densities; 0 where it says nothing. Of several cameras, how
    unlikely a shadow is, whatever else it may be.
    """
    seen = view.planes[1].astype(np.float32)
    empty = view.background.planes[1]
    ratio = cv2.blur(seen, (3, 3)) / np.maximum(cv2.blur(empty, (3, 3)), 1)
    darker = (ratio > view.background.shadow) & (ratio < 1 - CUT.flicker)
    inside = (~dilated(~darker, 3)).astype(np.float32)  # its edges are no texture
    side = 2 * _WINDOW * view.background.radius + 1

    def mean(image: RealArray) -> Float32Array:
        return np.asarray(cv2.blur(image * inside, (side, side)), np.float32)

    share, least = mean(np.ones_like(inside)), np.float32(1 / side)
    both, square = mean(seen * empty), mean(empty * empty)
    left = mean(seen * seen) - both * both / np.maximum(square, least)
    uneven = np.sqrt(np.maximum(left * share, 0)) / np.maximum(mean(seen), least)
    shadow, clothes = SHADOW.uneven
    usual = 0 if view.background.several else 2 * _FREEDOM * np.log(clothes / shadow)
    evidence = np.square(uneven / shadow) - usual
    return np.where(share > least, evidence, 0).astype(np.float32)
