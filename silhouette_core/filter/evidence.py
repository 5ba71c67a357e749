"""What one frame's silhouette says about every node of the tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.filter.window import SIZE, Window
from silhouette_core.image.distance import Target, Weighting, pixel_weights
from silhouette_core.library.pictures import reduce_silhouette
from silhouette_core.scoring.backend import Spans, signed_prefix

_SHIFT_PX = 1  # of a level's own pixels, either way: what the centroid's place leaves open


@dataclass(frozen=True, eq=False)
class Alignment:
    """How nodes lie on the silhouette. K nodes.

    Attributes:
        distance: (K,) float64, the least silhouette distance over scales and shifts.
        scale: (K,) int64, number of the window in which it was found.
        shift_px: (K, 2) int64, by which the node's silhouette was moved (right, down), in full-resolution pixels.
    """

    distance: NDArray[np.float64]
    scale: NDArray[np.int64]
    shift_px: NDArray[np.int64]


class Evidence:
    """A silhouette seen at several assumed distances, prepared for every resolution of the tree.

    Args:
        windows: the same silhouette through windows of different assumed distance, the expected one in the middle.
        weighting: of the disagreeing pixels.
    """

    def __init__(self, windows: Sequence[Window], weighting: Weighting = "nwxor"):
        """Keeps the windows; resolutions are prepared when asked for."""
        self.windows = tuple(windows)
        self.weighting: Weighting = weighting
        self._targets: dict[int, list[Target]] = {}

    def distances(self, spans: Spans, nodes: NDArray[np.integer], reduction: int) -> Alignment:
        """Measures chosen nodes.

        Args:
            spans: the level's representatives.
            nodes: (K,) which of them.
            reduction: 1, 2 or 4: how many times smaller than the window the level's pictures are.
        """
        shifts = np.array([(dx, dy) for dy in range(-_SHIFT_PX, _SHIFT_PX + 1) for dx in range(-_SHIFT_PX, _SHIFT_PX + 1)])
        found = np.stack([target.distances(spans, nodes, shifts) for target in self._prepared(reduction)])
        flat = found.reshape(-1, len(nodes))
        best = flat.argmin(axis=0)
        scale, move = np.divmod(best, len(shifts))
        return Alignment(flat[best, np.arange(len(nodes))], scale, shifts[move] * reduction)

    def _prepared(self, reduction: int) -> list[Target]:
        if reduction not in self._targets:
            self._targets[reduction] = [self._target(window, reduction) for window in self.windows]
        return self._targets[reduction]

    def _target(self, window: Window, reduction: int) -> Target:
        picture, weights = relative_weights(window, self.weighting, reduction)
        wide, margins = np.pad(picture, _SHIFT_PX), np.pad(weights, _SHIFT_PX, mode="edge")
        return Target(
            *signed_prefix(wide, margins.astype(np.float64) * picture.size), (SIZE[1] // reduction, SIZE[0] // reduction), _SHIFT_PX
        )


def relative_weights(window: Window, weighting: Weighting, reduction: int) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Weighs a window's pixels, relative to the whole silhouette's weight.

    The paper divides by the pixels of the region that holds both silhouettes, which is the same for all its pictures. Here the same person
    fills more or less of the window as the assumed distance changes, and the smaller picture would always seem to fit better.

    Args:
        window: the silhouette.
        weighting: see `pixel_weights`.
        reduction: 1, 2 or 4: how many times smaller than the window.

    Returns:
        the silhouette (h, w) bool at that resolution, and d_P (h, w) float64 over the sum of d_P in the silhouette; 0 where the camera does
        not reach: what it does not show speaks neither for nor against a pose.

    Source: Okada and Stenger, eq. (6)-(9).
    """
    picture, seen = window.picture, window.seen
    for _ in range(int(np.log2(reduction))):
        picture, seen = reduce_silhouette(picture), reduce_silhouette(seen)
    weights = np.where(seen, pixel_weights(picture, weighting), np.float32(0.0)).astype(np.float64)
    return picture, weights / max(float(weights[picture].sum()), 1e-6)
