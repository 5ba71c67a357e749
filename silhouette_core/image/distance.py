"""Distances of pixels from silhouettes, and thinning."""

from functools import cache

import cv2
import numpy as np

from calib.checks import BoolArray, Float32Array, check_array
from silhouette_core.image.kernels import distance as kernels


def distances_to(mask: BoolArray) -> Float32Array:
    """Distance (h, w) float32, pixels, of every pixel from the nearest of a mask (h, w) bool."""
    others = np.ascontiguousarray(~mask).view(np.uint8)
    distances: Float32Array = cv2.distanceTransform(others, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)  # type: ignore[assignment]
    # OpenCV's last digit depends on where the image lies in memory; the square is an integer.
    np.multiply(distances, distances, out=distances)
    np.rint(distances, out=distances)
    return np.sqrt(distances, out=distances)


def relative_depths(mask: BoolArray) -> Float32Array:
    """Depths (h, w) float32 of the pixels of a silhouette (h, w) bool that has a contour: from 0 at
    the contour and outside to 1 on the middle lines, whether a part is thick or thin.
    """
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    box = slice(max(top - 1, 0), top + height + 1), slice(max(left - 1, 0), left + width + 1)
    depth = distances_to(~mask[box])
    from_middle = distances_to(thin_silhouette(mask[box]))
    relative = np.zeros(mask.shape, np.float32)
    relative[box] = depth / np.maximum(depth + from_middle, np.float32(1e-6))
    return relative


def thin_silhouette(mask: BoolArray) -> BoolArray:
    """Middle lines of a silhouette (h, w) bool, one pixel wide and connected as it is, (h, w) bool.

    Source: Guo and Hall, Parallel thinning with two-subiteration algorithms (CACM 1989), A1.
    """
    check_array("mask", mask, ("h", "w"), np.bool_)
    image = np.zeros((mask.shape[0] + 2, mask.shape[1] + 2), np.uint8)
    image[1:-1, 1:-1] = mask
    kernels.thin_in_place(image, _removable())
    return image[1:-1, 1:-1].astype(bool)


@cache
def _removable() -> BoolArray:
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
