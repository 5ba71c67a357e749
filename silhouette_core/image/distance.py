"""How far apart two silhouettes are: XOR, wXOR and nwXOR, with weights that belong to the first of
the two.

The distance is the weighted disagreement over the number of pixels of the window (a density), and
lengths in the weights are counted in pixels of a picture 240 high, so that the same silhouettes
have about the same distance at every resolution. A silhouette that is empty or fills its window has
no contour; its weights are 1.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.image.kernels import distance as kernels

Weighting = Literal["xor", "wxor", "nwxor", "balanced"]
WEIGHTINGS: tuple[Weighting, ...] = ("xor", "wxor", "nwxor", "balanced")
_REACH = (
    12 / 240
)  # of the window's height: where the balanced weight outside is 1; about the half width of a trunk
_HEIGHT = 240


def pixel_weights(mask: NDArray[np.bool_], weighting: Weighting = "nwxor") -> NDArray[np.float32]:
    """Weighs the pixels of a silhouette's window.

    Args: mask: (h, w) bool, the silhouette P. weighting: "xor": 1 everywhere. "wxor": D_P + D_notP,
        the paper's w being 1. "nwxor": D_P / (D_P + D_Pmed) + w' D_notP with
            w' = 1 over the largest D_notP of the window, so that inside and outside have the same
            maximum. "balanced" (ours): the same inside, outside D_notP over a twentieth of the
            window's height, at most 1. With "nwxor" what is just outside costs next to nothing, so
            that a larger body always fits better; where the size is to be found as well, that must
            not be.

    Returns: (h, w) float32, d_P. D_P is the Euclidean distance to the nearest pixel outside, D_notP
        to the nearest inside, D_Pmed to the thinned silhouette.

    Raises:
        TypeError: mask is not bool.
        ValueError: mask is not (h, w), or no such weighting.

    Source: Okada and Stenger, eq. (6)-(9).
    """
    check_array("mask", mask, ("h", "w"), np.bool_)
    if weighting not in WEIGHTINGS:
        raise ValueError(f"weighting must be one of {', '.join(WEIGHTINGS)}, got {weighting!r}")
    pixels = mask.view(np.uint8)
    if weighting == "xor" or not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)
    weights = _distances(1 - pixels)
    # All that counts inside lies in the silhouette's box; one of the two terms is zero in every
    # pixel.
    left, top, width, height = cv2.boundingRect(pixels)
    box = slice(max(top - 1, 0), top + height + 1), slice(max(left - 1, 0), left + width + 1)
    inside = _distances(pixels[box])
    if weighting == "wxor":
        weights[box] += inside
        return weights * np.float32(_HEIGHT / len(mask))
    middle = _distances(1 - thin_silhouette(mask[box]).view(np.uint8))
    if weighting == "balanced":
        np.minimum(weights / np.float32(_REACH * len(mask)), np.float32(1.0), out=weights)
    else:
        weights /= weights.max()
    weights[box] += inside / np.maximum(inside + middle, np.float32(1e-6))
    return weights


def _distances(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Returns each pixel's Euclidean distance to the nearest zero, (h, w) float32."""
    found: NDArray[np.float32] = cv2.distanceTransform(
        np.ascontiguousarray(image), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )  # type: ignore[assignment]
    # OpenCV's last digit depends on where the image lies in memory; the square is an integer.
    np.multiply(found, found, out=found)
    np.rint(found, out=found)
    return np.sqrt(found, out=found)


def thin_silhouette(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Thins a silhouette (h, w) bool to lines of one pixel that keep its connections, (h, w) bool.

    Source: Guo and Hall, Parallel thinning with two-subiteration algorithms (CACM 1989), algorithm
    A1.
    """
    check_array("mask", mask, ("h", "w"), np.bool_)
    image = np.zeros((mask.shape[0] + 2, mask.shape[1] + 2), np.uint8)
    image[1:-1, 1:-1] = mask
    kernels.thin_in_place(image, _removable())
    return image[1:-1, 1:-1].astype(bool)


@cache
def _removable() -> NDArray[np.bool_]:
    """Returns (2, 256) bool: whether a pixel with these eight neighbours, clockwise from the upper
    left, goes in each of two passes.
    """
    p1, p2, p3, p4, p5, p6, p7, p8 = ((np.arange(256) >> i) & 1 == 1 for i in range(8))
    crossings = sum(
        a.astype(int) for a in (~p2 & (p3 | p4), ~p4 & (p5 | p6), ~p6 & (p7 | p8), ~p8 & (p1 | p2))
    )
    pairs_one = sum(a.astype(int) for a in (p1 | p2, p3 | p4, p5 | p6, p7 | p8))
    pairs_two = sum(a.astype(int) for a in (p2 | p3, p4 | p5, p6 | p7, p8 | p1))
    neighbours = np.minimum(pairs_one, pairs_two)
    edge = (crossings == 1) & (neighbours >= 2) & (neighbours <= 3)
    return np.stack([edge & ~((p2 | p3 | ~p5) & p4), edge & ~((p6 | p7 | ~p1) & p8)])
