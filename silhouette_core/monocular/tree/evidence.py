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
from silhouette_core.scoring.cpu import CPU
from silhouette_core.scoring.target import Target

_REACH = range(-1, 2)
SHIFTS_PX = np.array([(right, down) for down in _REACH for right in _REACH])
"""(S, 2): how nodes are moved (right, down), in a level's own pixels: what the centroid's position
leaves open."""
_NOT_MOVED = len(SHIFTS_PX) // 2


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

    def among(
        self,
        rows: NDArray[np.integer],
        distance: NDArray[np.float64],
        scale: NDArray[np.int64],
    ) -> Alignment:
        """Alignment of more nodes, of which these are some `rows` (K,), and the others are not
        moved: distances (N,) and windows (N,) of all.
        """
        shift = np.zeros((len(distance), 2), np.int64)
        distance[rows], scale[rows], shift[rows] = self.distance, self.scale, self.shift_px
        return Alignment(distance, scale, shift)


class Evidence:
    """A silhouette seen at several assumed distances, prepared for every resolution of the tree.

    Args:
        windows: The same silhouette through windows of different assumed distance, the expected one
            in the middle.
        weighting: Of the disagreeing pixels.
        backend: Scores the nodes.
        bounds_px: Rectangle of the library whose nodes they are, see `pixel_weights`; None: the
            window.
        drawn_small: Whether the library's silhouettes were drawn at the resolution of their level,
            and not reduced to it: each of their pixels then stands for a block of the window, which
            is weighed as a whole, and shifts are by pixels of the window at any resolution.
    """

    def __init__(
        self,
        windows: Sequence[Window],
        weighting: Weighting = "nwxor",
        backend: Backend = CPU,
        bounds_px: Rectangle | None = None,
        drawn_small: bool = False,
    ):
        """Keeps the windows; resolutions are prepared when needed."""
        self.windows = tuple(windows)
        self.weighting: Weighting = weighting
        self.backend, self.bounds_px, self.drawn_small = backend, bounds_px, drawn_small
        self._targets: dict[int, Target] = {}
        self._unmoved: dict[int, list[Target]] = {}
        self._whole: list[tuple[NDArray[np.bool_], NDArray[np.float64]]] = []
        self._pairs: dict[int, list[tuple[NDArray[np.bool_], NDArray[np.float64]]]] = {}

    def distances(self, spans: Spans, nodes: NDArray[np.integer], reduction: int) -> Alignment:
        """Best alignment of each node with the silhouette.

        Args:
            spans: The level's representatives.
            nodes: (K,) which of them.
            reduction: 1, 2 or 4: how many times smaller than the window the level's images are.
        """
        target = self._target(reduction)
        distances = self.backend.span_distances(target, spans, nodes)
        best = distances.argmin(axis=1)
        scale, shift = np.divmod(best, len(SHIFTS_PX))
        step_px = 1 if self.drawn_small else reduction
        return Alignment(distances[np.arange(len(nodes)), best], scale, SHIFTS_PX[shift] * step_px)

    def unmoved_distances(
        self,
        spans: Spans,
        nodes: NDArray[np.integer],
        reduction: int,
        scale: NDArray[np.integer] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Distances of nodes that are not moved, a tenth of the work of `distances`.

        Args:
            spans: The level's representatives.
            nodes: (K,) which of them.
            reduction: See `distances`.
            scale: (K,) number of the window of each node; None: the one of the least distance.

        Returns:
            Distances (K,) float64 and the numbers of their windows (K,) int64.
        """
        if reduction not in self._unmoved:
            pairs = self._weighed(reduction)
            if self.drawn_small:
                pairs = pairs[_NOT_MOVED :: len(SHIFTS_PX)]
            self._unmoved[reduction] = [Target((mask,), (weights,)) for mask, weights in pairs]
        least = np.full(len(nodes), np.inf)
        chosen = np.zeros(len(nodes), np.int64)
        for number, unmoved in enumerate(self._unmoved[reduction]):
            rows = np.arange(len(nodes)) if scale is None else np.flatnonzero(scale == number)
            distance = self.backend.span_distances(unmoved, spans, nodes[rows])[:, 0]
            nearer = distance < least[rows]
            least[rows[nearer]], chosen[rows[nearer]] = distance[nearer], number
        return least, chosen

    def _target(self, reduction: int) -> Target:
        """All windows at a resolution, with all shifts."""
        if reduction not in self._targets:
            masks, weights = zip(*self._weighed(reduction), strict=True)
            shifts = SHIFTS_PX[_NOT_MOVED : _NOT_MOVED + 1] if self.drawn_small else SHIFTS_PX
            self._targets[reduction] = Target(masks, weights, shifts)
        return self._targets[reduction]

    def _weighed(self, reduction: int) -> list[tuple[NDArray[np.bool_], NDArray[np.float64]]]:
        """Silhouette and weights of every window at a resolution; if the library was drawn small,
        of every window and shift, those of one window next to each other.
        """
        if reduction not in self._pairs:
            if not self.drawn_small:
                pairs = self._relative(reduction)
            else:
                if not self._whole:
                    self._whole = self._relative(1)
                pairs = [pair for whole in self._whole for pair in block_weights(*whole, reduction)]
            self._pairs[reduction] = pairs
        return self._pairs[reduction]

    def _relative(self, reduction: int) -> list[tuple[NDArray[np.bool_], NDArray[np.float64]]]:
        """Silhouette and weights of every window at a resolution, see `relative_weights`."""
        return [
            relative_weights(window, self.weighting, reduction, self.bounds_px)
            for window in self.windows
        ]


def block_weights(
    mask: NDArray[np.bool_],
    weights: NDArray[np.float64],
    reduction: int,
) -> list[tuple[NDArray[np.bool_], NDArray[np.float64]]]:
    """Silhouette and weights whose pixels are blocks of a larger image.

    The weighted disagreement with a silhouette of such blocks is that of the larger images, but for
    what no silhouette of blocks could avoid.

    Args:
        mask: (H, W) bool, the silhouette P.
        weights: (H, W) float64, d_P.
        reduction: 1, 2 or 4: width of a block.

    Returns:
        For every one of the `SHIFTS_PX`, in pixels of the larger image: where most of a block's
        weight is in the silhouette (h, w) bool, and by how much (h, w) float64.
    """
    sums = np.pad(np.where(mask, -weights, weights), ((1, reduction), (1, reduction)), mode="edge")
    width = 1
    while width < reduction:  # sums over blocks that begin at every pixel
        rows = sums[:-width] + sums[width:]
        sums, width = rows[:, :-width] + rows[:, width:], 2 * width
    height, wide = mask.shape[0] // reduction, mask.shape[1] // reduction
    result = []
    for right, down in SHIFTS_PX:
        rows = sums[1 + down :: reduction][:height]
        signed = np.ascontiguousarray(rows[:, 1 + right :: reduction][:, :wide])
        result.append((signed < 0, np.abs(signed)))
    return result
