"""Pixel weights of the silhouette distances XOR, wXOR and nwXOR, and thinning.

The weights belong to the first of the two silhouettes that are compared. The distance is the
weighted disagreement over the number of pixels of the window (a density), and lengths in the
weights are counted in pixels of an image 240 high, so that the same silhouettes have about the same
distance at every resolution. A silhouette that is empty or fills its window has no contour; its
weights are 1. The distances themselves are scored by `silhouette_core.scoring`.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.image.kernels import distance as kernels
from silhouette_core.image.spans import Rectangle

Weighting = Literal["xor", "wxor", "nwxor", "balanced"]
WEIGHTINGS: tuple[Weighting, ...] = ("xor", "wxor", "nwxor", "balanced")
# Distance, as a fraction of the window's height, at which the balanced weight outside is 1: about
# half the width of a trunk.
_REACH = 12 / 240
_HEIGHT = 240


def pixel_weights(
    mask: NDArray[np.bool_], weighting: Weighting = "nwxor", bounds_px: Rectangle | None = None
) -> NDArray[np.float32]:
    r"""Weights of the pixels of a silhouette's window.

    The density of disagreeing pixels, "xor", weighs all of them alike:

    .. math::
        :label: okada-6

        d_{XOR}(P, Q) = \frac{1}{|W|} \sum_{x \in W} |P(x) - Q(x)|

    The weighted distances count every one by its distance from the contour of the silhouette P,
    :math:`D_P` inside and :math:`D_{\neg P}` outside of it. "wxor", with w = 1:

    .. math::
        :label: okada-8

        d_P = D_P + w \, D_{\neg P}

    "nwxor" is normalised by the distance :math:`D_{P_{med}}` to the thinned silhouette, so that
    thick and thin parts count alike:

    .. math::
        :label: okada-9

        d_P = \frac{D_P}{D_P + D_{P_{med}}} + w' \, D_{\neg P}

    with w' one over the largest :math:`D_{\neg P}` in the rectangle that holds every pose of the
    tree, the outer limit of the outside: inside and outside have the same maximum in it. "balanced"
    (ours) is the same inside, and outside :math:`D_{\neg P}` over a twentieth
    of the window's height, at most 1. With "nwxor" what is just outside costs next to nothing, so
    that a larger body always fits better; where the size is estimated as well, that must not be.

    Args:
        mask: (h, w) bool, the silhouette P.
        weighting: One of `WEIGHTINGS`.
        bounds_px: That rectangle, `PoseLibrary.bounds_px`, in pixels of an image 240 high, whatever
            h is; None, where there is no library, or where the silhouette covers it: the window.

    Returns:
        (h, w) float32, d_P. With "nwxor" it exceeds 1 beyond the rectangle, where no pose is.

    Raises:
        TypeError: mask is not bool.
        ValueError: mask is not (h, w), or no such weighting.

    Source: Okada and Stenger, eq. (6)-(9); the value of w, and "balanced", are ours.
    """
    check_array("mask", mask, ("h", "w"), np.bool_)
    if weighting not in WEIGHTINGS:
        raise ValueError(f"weighting must be one of {', '.join(WEIGHTINGS)}, got {weighting!r}")
    pixels = mask.view(np.uint8)
    if weighting == "xor" or not mask.any() or mask.all():
        return np.ones(mask.shape, np.float32)  # eq. (6)
    weights = _distances(1 - pixels)
    # All that counts inside lies in the silhouette's box; one of the two terms is zero in every
    # pixel.
    left, top, width, height = cv2.boundingRect(pixels)
    box = slice(max(top - 1, 0), top + height + 1), slice(max(left - 1, 0), left + width + 1)
    inside = _distances(pixels[box])
    if weighting == "wxor":
        weights[box] += inside  # eq. (8)
        return weights * np.float32(_HEIGHT / len(mask))
    middle = _distances(1 - thin_silhouette(mask[box]).view(np.uint8))
    if weighting == "balanced":
        np.minimum(weights / np.float32(_REACH * len(mask)), np.float32(1.0), out=weights)
    else:
        weights /= _largest(weights, bounds_px)
    weights[box] += inside / np.maximum(inside + middle, np.float32(1e-6))  # eq. (9)
    return weights


def _largest(weights: NDArray[np.float32], bounds_px: Rectangle | None) -> np.float32:
    """Largest weight in a rectangle, in pixels of an image 240 high; without any, in the window."""
    if bounds_px is not None:
        left, top, right, bottom = np.array(bounds_px) * (len(weights) / _HEIGHT)
        columns, rows = (
            slice(int(np.floor(first)), int(np.ceil(last)))
            for first, last in ((left, right), (top, bottom))
        )
        largest = weights[rows, columns].max(initial=np.float32(0.0))
        if largest > 0:
            return largest
    return weights.max()


def _distances(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Returns each pixel's Euclidean distance to the nearest zero, (h, w) float32."""
    distances: NDArray[np.float32] = cv2.distanceTransform(
        np.ascontiguousarray(image), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )  # type: ignore[assignment]
    # OpenCV's last digit depends on where the image lies in memory; the square is an integer.
    np.multiply(distances, distances, out=distances)
    np.rint(distances, out=distances)
    return np.sqrt(distances, out=distances)


def thin_silhouette(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Middle lines of a silhouette (h, w) bool, one pixel wide and connected as it is, (h, w) bool.

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
