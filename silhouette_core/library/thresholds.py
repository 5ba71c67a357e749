"""Choosing the tree's thresholds so that its levels have about as many nodes as wanted.

The first level is tried on samples drawn at random, of several sizes, and what their numbers of
nodes do is carried on to the whole library; the other levels are tried on some of the nodes above,
whose children are counted exactly. All distances among the samples of a small draw are measured
once, so that trying a threshold is quick.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from silhouette_core.library.tree import Poses, Scorer, Split
from silhouette_core.progress import Reporter

_DRAWN = 3200
_LARGER = 12_800
_CORRECTIONS = 2
_NEARBY = 1.15
_FALL = 0.88
_STEPS = 24
_SETS_DRAWN = 2000  # samples in the sets that are tried at the other levels, about


@dataclass(frozen=True, eq=False)
class Table:
    """Distances among a few samples, measured once; stands in for a Scorer.

    Attributes:
        samples: (n,) int64, rising.
        distances: (n, n) float64, row by row from each as the representative.
    """

    samples: NDArray[np.int64]
    distances: NDArray[np.float64]

    @classmethod
    def of(
        cls, samples: NDArray[np.int64], score: Scorer, reporter: Reporter | None = None
    ) -> Table:
        """Measures all of them."""
        distances = np.empty((len(samples), len(samples)))
        for row, representative in zip(distances, samples, strict=True):
            row[:] = score(int(representative), samples, threads=len(samples) > 256)
            if reporter is not None:
                reporter.advance()
        return cls(samples, distances)

    def __call__(
        self, representative: int, samples: NDArray[np.int64], threads: bool
    ) -> NDArray[np.float64]:
        """Looks distances up, as `Scorer` measures them."""
        row = self.distances[np.searchsorted(self.samples, representative)]
        return (
            row
            if len(samples) == len(self.samples)
            else row[np.searchsorted(self.samples, samples)]
        )

    def nodes(self, samples: NDArray[np.int64], poses: Poses, threshold: float) -> int:
        """Counts the nodes into which `samples` (some of them, rising) would be divided."""
        split = Split.start(samples, poses)
        split.run(self, threshold)
        return len(split.chosen)


def first_threshold(
    count: int, wanted: int, poses: Poses, score: Scorer, reporter: Reporter
) -> float:
    """Chooses T_1.

    Args:
        count: samples in the library, N.
        wanted: nodes wanted.
        poses: the pose space.
        score: distances at the first level.
        reporter: told of every distance row that is measured.
    """
    shuffled = np.random.default_rng(0).permutation(count).astype(np.int64)
    reporter.stage("choosing thresholds")
    table = Table.of(np.sort(shuffled[:_DRAWN]), score, reporter)
    nodes = partial(table.nodes, table.samples, poses)
    highest = float(table.distances.max())
    if count <= _DRAWN:
        return _bisect(nodes, wanted, highest)
    half = np.sort(shuffled[: _DRAWN // 2])
    threshold = _bisect(
        lambda threshold: _carried_on(
            table.nodes(half, poses, threshold), nodes(threshold), count / _DRAWN
        ),
        wanted,
        highest,
    )
    larger = min(count, _LARGER)
    for _ in range(_CORRECTIONS):
        found = []
        for draw in (larger // 2, larger):
            split = Split.start(np.sort(shuffled[:draw]), poses)
            split.run(score, threshold, lambda _: reporter.advance(), threads=True)
            found.append(len(split.chosen))
        # How steeply the number of nodes falls is taken from the small draw.
        steepness = np.log(nodes(threshold / _NEARBY) / nodes(threshold * _NEARBY)) / np.log(
            _NEARBY**2
        )
        threshold *= (_carried_on(found[0], found[1], count / larger) / wanted) ** (
            1 / max(float(steepness), 0.2)
        )
    return threshold


def _carried_on(before: int, now: int, times: float) -> float:
    """Returns how many nodes `times` as many samples make, if half as many as now made `before`.

    Nodes grow by ever less with every doubling of the samples; on recorded motion the exponent fell
    by an eighth each time.
    """
    doublings = np.log2(times)
    return float(now * (now / before) ** (_FALL * (1 - _FALL**doublings) / (1 - _FALL)))


def next_threshold(
    sets: list[NDArray[np.int64]], wanted: int, poses: Poses, score: Scorer
) -> float:
    """Chooses T_l of a level below the first.

    Args:
        sets: the samples of every node of the level above, rising.
        wanted: nodes wanted.
        poses: the pose space.
        score: distances at this level.
    """
    larger = [samples for samples in sets if len(samples) > 1]
    if not larger:
        return 0.0
    rng = np.random.default_rng(0)
    tables, drawn = [], 0
    for k in rng.permutation(len(larger)):
        if drawn >= _SETS_DRAWN and len(tables) >= 8:
            break
        if len(larger[k]) <= _SETS_DRAWN:
            tables.append(Table.of(larger[k], score))
            drawn += len(larger[k])
    if not tables:
        tables = [Table.of(np.sort(rng.permutation(larger[0])[:_SETS_DRAWN]), score)]
    # What is wanted of the sets drawn: each is to fall apart as the average larger set has to.
    per_sample = (wanted - len(sets) + len(larger)) / sum(len(samples) for samples in larger)
    target = per_sample * sum(len(table.samples) for table in tables)
    highest = max(float(table.distances.max()) for table in tables)
    return _bisect(
        lambda threshold: float(
            sum(table.nodes(table.samples, poses, threshold) for table in tables)
        ),
        target,
        highest,
    )


def _bisect(nodes: Callable[[float], float], wanted: float, highest: float) -> float:
    """Returns the threshold, from 0 to `highest`, at which a falling number of nodes comes to
    `wanted`.
    """
    low, high = 0.0, highest
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if nodes(middle) > wanted else (low, middle)
        if high - low < 1e-3 * high:
            break
    return (low + high) / 2
