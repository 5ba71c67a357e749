"""What one frame's silhouette says about every node of the tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.filter.kernels import shifts as kernels
from silhouette_core.filter.window import SIZE, Window
from silhouette_core.image.distance import Weighting, pixel_weights
from silhouette_core.image.kernels.distance import padded_prefix
from silhouette_core.image.spans import Spans
from silhouette_core.library.rendering import reduce_silhouette

_MARGIN_PX = 1
_REACH = range(-_MARGIN_PX, _MARGIN_PX + 1)
SHIFTS_PX = np.array([(right, down) for down in _REACH for right in _REACH])
"""(S, 2): how nodes are moved (right, down), in a level's own pixels: what the centroid's place
leaves open.
"""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How nodes lie on the silhouette. K nodes.

    Attributes: distance: (K,) float64, the least silhouette distance over scales and shifts. scale:
        (K,) int64, number of the window in which it was found. shift_px: (K, 2) int64, by which the
        node's silhouette was moved (right, down), in full-resolution pixels.
    """

    distance: NDArray[np.float64]
    scale: NDArray[np.int64]
    shift_px: NDArray[np.int64]


class Evidence:
    """A silhouette seen at several assumed distances, prepared for every resolution of the tree.

    Args: windows: the same silhouette through windows of different assumed distance, the expected
        one in the middle. weighting: of the disagreeing pixels.
    """

    def __init__(self, windows: Sequence[Window], weighting: Weighting = "nwxor"):
        """Keeps the windows; resolutions are prepared when asked for."""
        self.windows = tuple(windows)
        self.weighting: Weighting = weighting
        self._tables: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def distances(self, spans: Spans, nodes: NDArray[np.integer], reduction: int) -> Alignment:
        """Measures chosen nodes.

        Args:
            spans: the level's representatives.
            nodes: (K,) which of them.
            reduction: 1, 2 or 4: how many times smaller than the window the level's pictures are.
        """
        table, bases = self._prepared(reduction)
        found = np.empty((len(nodes), len(bases)))
        runs = spans.rows, spans.starts, spans.ends, spans.offsets
        kernels.shifted_distances(table, bases, *runs, np.ascontiguousarray(nodes), found)
        best = found.argmin(axis=1)
        scale, move = np.divmod(best, len(SHIFTS_PX))
        return Alignment(found[np.arange(len(nodes)), best], scale, SHIFTS_PX[move] * reduction)

    def _prepared(self, reduction: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns prefix sums and weights of the silhouette for every window and shift, see
        `kernels.interleave`.
        """
        if reduction not in self._tables:
            height, width = SIZE[1] // reduction, SIZE[0] // reduction
            prefixes = np.empty(
                (len(self.windows), height + 2 * _MARGIN_PX, width + 2 * _MARGIN_PX + 1)
            )
            bases = [
                padded_prefix(
                    *relative_weights(window, self.weighting, reduction), _MARGIN_PX, prefix
                )
                for window, prefix in zip(self.windows, prefixes, strict=True)
            ]
            table = np.empty((height, width + 1, len(bases) * len(SHIFTS_PX)))
            kernels.interleave(prefixes, SHIFTS_PX, _MARGIN_PX, table)
            self._tables[reduction] = table, np.repeat(bases, len(SHIFTS_PX))
        return self._tables[reduction]


def relative_weights(
    window: Window, weighting: Weighting, reduction: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Weighs a window's pixels, relative to the whole silhouette's weight.

    The paper divides by the pixels of the region that holds both silhouettes, which is the same for
    all its pictures. Here the same person fills more or less of the window as the assumed distance
    changes, and the smaller picture would always seem to fit better.

    Args:
        window: the silhouette.
        weighting: see `pixel_weights`.
        reduction: 1, 2 or 4: how many times smaller than the window.

    Returns: the silhouette (h, w) bool at that resolution, and d_P (h, w) float64 over the sum of
        d_P in the silhouette; 0 where the camera does not reach: what it does not show speaks
        neither for nor against a pose.

    Source: Okada and Stenger, eq. (6)-(9).
    """
    picture, seen = window.picture, window.seen
    for _ in range(int(np.log2(reduction))):
        picture, seen = reduce_silhouette(picture), reduce_silhouette(seen)
    weights = np.where(seen, pixel_weights(picture, weighting), np.float32(0.0)).astype(np.float64)
    return picture, weights / max(float(weights[picture].sum()), 1e-6)
