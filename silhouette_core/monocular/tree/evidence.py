"""Alignment of the tree's nodes with one frame's silhouette."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.distance import Weighting
from silhouette_core.image.spans import Rectangle, Spans
from silhouette_core.monocular.silhouette_weights import relative_weights
from silhouette_core.monocular.window import Window
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.target import Target

_REACH = range(-1, 2)
SHIFTS_PX = np.array([(right, down) for down in _REACH for right in _REACH])
"""(S, 2): how nodes are moved (right, down), in a level's own pixels: what the centroid's position
leaves open."""
UNMOVED = np.zeros((1, 2), np.int64)
"""The same, not at all."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Best alignment of K nodes with the silhouette.

    Attributes:
        distance: (K,) float64, smallest silhouette distance over scales and shifts.
        scale: (K,) int64, number of the window in which it is reached.
        shift_px: (K, 2) int64, by which the node's silhouette is moved (right, down), in
            full-resolution pixels.
    """

    distance: NDArray[np.float64]
    scale: NDArray[np.int64]
    shift_px: NDArray[np.int64]

    def among(self, rows: NDArray[np.integer], others: Alignment) -> Alignment:
        """Alignment of more nodes, of which these are some `rows` (K,)."""
        replaced = Alignment(others.distance.copy(), others.scale.copy(), others.shift_px.copy())
        replaced.distance[rows], replaced.scale[rows] = self.distance, self.scale
        replaced.shift_px[rows] = self.shift_px
        return replaced


class Evidence:
    """A silhouette seen at several assumed distances, prepared for every resolution of the tree.

    Args:
        windows: The same silhouette through windows of different assumed distance, the expected one
            in the middle.
        bounds_px: Rectangle of the library whose nodes they are, see `pixel_weights`; None: the
            window.
    """

    def __init__(
        self,
        windows: Sequence[Window],
        backend: Backend,
        weighting: Weighting = "nwxor",
        bounds_px: Rectangle | None = None,
    ):
        """Keeps the windows; resolutions are prepared when needed."""
        self.windows = tuple(windows)
        self.weighting: Weighting = weighting
        self.backend, self.bounds_px = backend, bounds_px
        self._weighed: dict[int, list[tuple[NDArray[np.bool_], NDArray[np.float64]]]] = {}

    def distances(
        self,
        spans: Spans,
        nodes: NDArray[np.integer],
        reduction: int,
        shifts_px: NDArray[np.int64] = SHIFTS_PX,
    ) -> Alignment:
        """Best alignment of each node with the silhouette.

        Args:
            nodes: (K,) which of them.
            reduction: 1, 2 or 4: how many times smaller than the window the level's images are.
            shifts_px: (S, 2), see `SHIFTS_PX`; `UNMOVED` is a ninth of the work.
        """
        if reduction not in self._weighed:
            self._weighed[reduction] = [
                relative_weights(window, self.weighting, reduction, self.bounds_px)
                for window in self.windows
            ]
        masks, weights = zip(*self._weighed[reduction], strict=True)
        target = Target(masks, weights, shifts_px)
        distances = self.backend.span_distances(target, spans, nodes)
        best = distances.argmin(axis=1)
        scale, shift = np.divmod(best, len(shifts_px))
        shift_px = shifts_px[shift] * reduction
        return Alignment(distances[np.arange(len(nodes)), best], scale, shift_px)
