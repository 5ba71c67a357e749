"""How far apart two silhouettes are: XOR, wXOR and nwXOR, with weights that belong to the first of
the two.

The distance is the weighted disagreement over the number of pixels of the window (a density), and
lengths in the weights are counted in pixels of a picture 240 high, so that the same silhouettes
have about the same distance at every resolution. A silhouette that is empty or fills its window has
no contour; its weights are 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.image.kernels import distance as kernels
from silhouette_core.image.spans import Spans

Weighting = Literal["xor", "wxor", "nwxor", "balanced"]
WEIGHTINGS: tuple[Weighting, ...] = ("xor", "wxor", "nwxor", "balanced")
_REACH = (
    12 / 240
)  # of the window's height: where the balanced weight outside is 1; about the half width of a trunk
_HEIGHT = 240
_FEW = 512  # silhouettes for which starting threads costs more than it brings


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


def silhouette_distances(
    mask: NDArray[np.bool_], silhouettes: NDArray[np.bool_], weights: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Measures distances pixel by pixel, compiled.

    Args:
        mask: (h, w) bool, the first silhouette.
        silhouettes: (K, h, w) bool, the others.
        weights: (h, w), its weights.

    Returns:
        (K,) float64.

    Source: Okada and Stenger, eq. (6)-(9).
    """
    check_array("silhouettes", silhouettes, ("K", *mask.shape))
    check_array("weights", weights, mask.shape)
    distances = np.empty(len(silhouettes))
    kernels.dense_distance(mask, weights, silhouettes, distances)
    return distances / mask.size


@dataclass(frozen=True, eq=False)
class Target:
    """A silhouette prepared for being compared with many others, given as runs.

    Attributes: prefix: (h + 2 m, w + 2 m + 1) float64, sums along rows of the signed weights,
        `margin_px` m wider than the window on all sides, so
            that others may be moved by that much. Beyond the window the weight at its border goes
            on.
        base: the silhouette's own weight.
        shape: (h, w) of the window.
        margin_px: m.
    """

    prefix: NDArray[np.float64]
    base: float
    shape: tuple[int, int]
    margin_px: int

    @classmethod
    def of(
        cls, mask: NDArray[np.bool_], weighting: Weighting = "nwxor", margin_px: int = 0
    ) -> Target:
        """Prepares a silhouette.

        Args:
            mask: (h, w) bool.
            weighting: see `pixel_weights`.
            margin_px: the largest shift, in rows or columns, that `distances` will be asked for.
        """
        weights = pixel_weights(mask, weighting)
        prefix = np.empty((mask.shape[0] + 2 * margin_px, mask.shape[1] + 2 * margin_px + 1))
        return cls(
            prefix, kernels.padded_prefix(mask, weights, margin_px, prefix), mask.shape, margin_px
        )

    def distances(
        self,
        spans: Spans,
        which: NDArray[np.integer] | None = None,
        shifts_px: NDArray[np.integer] | None = None,
        threads: bool = True,
    ) -> NDArray[np.float64]:
        """Measures the distance from this silhouette to others.

        Args: spans: silhouettes within a window of this size; not checked, since that would read
            all of a library. which: (K,) numbers of the silhouettes to be measured; None: all.
            shifts_px: (S, 2) whole pixels (right, down) by which the others are moved, each at most
            the margin; None: not moved. threads: False keeps to the calling thread, for callers
            that are threads themselves. The results are the same.

        Returns:
            (K,) float64, or (S, K) where shifts are given.

        Raises:
            ValueError: a shift beyond the margin, a number that no silhouette has.

        Source: Okada and Stenger, eq. (6)-(9), rearranged: with P the silhouette, d its weights and
        s = d (1 - 2 P), the weighted XOR with Q is sum(d P) + sum of s over Q, two look-ups of a
        prefix sum for every run of Q.
        """
        chosen = np.arange(len(spans)) if which is None else np.ascontiguousarray(which)
        if len(chosen) and which is not None and (chosen.min() < 0 or chosen.max() >= len(spans)):
            raise ValueError(
                f"which must be 0 to {len(spans) - 1}, got {chosen.min()} to {chosen.max()}"
            )
        shifts = (
            np.zeros((1, 2), np.int64) if shifts_px is None else np.asarray(shifts_px, np.int64)
        )
        check_array("shifts_px", shifts, ("S", 2))
        if len(shifts) and np.abs(shifts).max() > self.margin_px:
            raise ValueError(
                f"shifts_px must be at most the margin, {self.margin_px} px, got {shifts.tolist()}"
            )
        width = self.prefix.shape[1]
        origins = ((shifts[:, 1] + self.margin_px) * width + shifts[:, 0] + self.margin_px).astype(
            np.uint32
        )
        found = np.empty((len(origins), len(chosen)))
        score = (
            kernels.span_distance_parallel
            if threads and len(chosen) * len(origins) >= _FEW
            else kernels.span_distance
        )
        scale = 1.0 / (self.shape[0] * self.shape[1])
        flat = np.ascontiguousarray(self.prefix).reshape(-1)
        score(
            flat,
            np.uint32(width),
            self.base,
            scale,
            spans.rows,
            spans.starts,
            spans.ends,
            spans.offsets,
            chosen,
            origins,
            found,
        )
        return found[0] if shifts_px is None else found
