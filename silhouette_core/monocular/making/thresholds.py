"""Choice of the tree's thresholds for given numbers of nodes.

For the first level, nodes are counted on random draws of several sizes and extrapolated to the
whole library; for the other levels, the children of some nodes are counted exactly. All distances
within a small draw are computed once, so that a threshold is quickly evaluated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from silhouette_core.monocular.tree.tree import PoseSpace, Scorer, Split
from silhouette_core.progress import Reporter

_DRAWN = 3200  # samples of the draw whose distances are tabulated
_LARGER = 12_800  # samples of the draw on which the threshold is corrected
_CORRECTIONS = 2
_NEARBY = 1.15  # factor between the thresholds from which the slope is computed
_DECAY = 0.88  # of the exponent of growth, with every doubling of the samples
_STEPS = 24
_SETS_DRAWN = 2000  # about the number of samples in the sets on which other levels are evaluated


@dataclass(frozen=True, eq=False)
class DistanceTable:
    """Table of the distances among n samples, used instead of a Scorer.

    Attributes:
        samples: (n,) int64, increasing.
        distances: (n, n) float64, each row from one sample as the representative.
    """

    samples: NDArray[np.int64]
    distances: NDArray[np.float64]

    @classmethod
    def from_samples(
        cls, samples: NDArray[np.int64], score: Scorer, reporter: Reporter | None = None
    ) -> DistanceTable:
        """Computes all distances among samples (n,)."""
        distances = np.empty((len(samples), len(samples)))
        for row, representative in zip(distances, samples, strict=True):
            row[:] = score(int(representative), samples, threads=len(samples) > 256)
            if reporter is not None:
                reporter.advance()
        return cls(samples, distances)

    def __call__(
        self, representative: int, samples: NDArray[np.int64], threads: bool
    ) -> NDArray[np.float64]:
        """Distances (n,) from a representative to `samples` (n,), see `Scorer`."""
        row = self.distances[np.searchsorted(self.samples, representative)]
        return (
            row
            if len(samples) == len(self.samples)
            else row[np.searchsorted(self.samples, samples)]
        )

    def nodes(self, samples: NDArray[np.int64], poses: PoseSpace, threshold: float) -> int:
        """Number of nodes into which `samples`, an increasing subset, would be divided."""
        split = Split.start(samples, poses)
        split.run(self, threshold)
        return len(split.chosen)


def first_threshold(
    count: int, target: int, poses: PoseSpace, score: Scorer, reporter: Reporter
) -> float:
    """Threshold T_1 of the first level.

    Args:
        count: number of samples in the library, N.
        target: number of nodes aimed at.
        poses: the pose space.
        score: silhouette distances at the first level.
        reporter: informed of every row of distances.
    """
    shuffled = np.random.default_rng(0).permutation(count).astype(np.int64)
    reporter.stage("choosing thresholds")
    table = DistanceTable.from_samples(np.sort(shuffled[:_DRAWN]), score, reporter)
    nodes = partial(table.nodes, table.samples, poses)
    highest = float(table.distances.max())
    if count <= _DRAWN:
        return _bisect(nodes, target, highest)
    half = np.sort(shuffled[: _DRAWN // 2])
    threshold = _bisect(
        lambda threshold: _extrapolated(
            table.nodes(half, poses, threshold), nodes(threshold), count / _DRAWN
        ),
        target,
        highest,
    )
    larger = min(count, _LARGER)
    for _ in range(_CORRECTIONS):
        counts = []
        for draw in (larger // 2, larger):
            split = Split.start(np.sort(shuffled[:draw]), poses)
            split.run(score, threshold, lambda _: reporter.advance(), threads=True)
            counts.append(len(split.chosen))
        # The slope of the number of nodes is that of the small draw.
        steepness = np.log(nodes(threshold / _NEARBY) / nodes(threshold * _NEARBY)) / np.log(
            _NEARBY**2
        )
        threshold *= (_extrapolated(counts[0], counts[1], count / larger) / target) ** (
            1 / max(float(steepness), 0.2)
        )
    return threshold


def _extrapolated(half: int, full: int, times: float) -> float:
    """Number of nodes of `times` as many samples, from those of a draw and of half the draw.

    The number grows by less with every doubling of the samples; on recorded motion the exponent
    fell by an eighth each time.
    """
    doublings = np.log2(times)
    return float(full * (full / half) ** (_DECAY * (1 - _DECAY**doublings) / (1 - _DECAY)))


def next_threshold(
    sets: list[NDArray[np.int64]], target: int, poses: PoseSpace, score: Scorer
) -> float:
    """Threshold T_l of a level below the first.

    Args:
        sets: the samples of every node of the level above, increasing.
        target: number of nodes aimed at.
        poses: the pose space.
        score: silhouette distances at this level.
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
            tables.append(DistanceTable.from_samples(larger[k], score))
            drawn += len(larger[k])
    if not tables:
        tables = [
            DistanceTable.from_samples(np.sort(rng.permutation(larger[0])[:_SETS_DRAWN]), score)
        ]
    # The drawn sets shall be divided into as many nodes per sample as all larger sets together.
    per_sample = (target - len(sets) + len(larger)) / sum(len(samples) for samples in larger)
    of_drawn = per_sample * sum(len(table.samples) for table in tables)
    highest = max(float(table.distances.max()) for table in tables)
    return _bisect(
        lambda threshold: float(
            sum(table.nodes(table.samples, poses, threshold) for table in tables)
        ),
        of_drawn,
        highest,
    )


def _bisect(nodes: Callable[[float], float], target: float, highest: float) -> float:
    """Threshold between 0 and `highest` at which a decreasing number of nodes reaches `target`."""
    low, high = 0.0, highest
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if nodes(middle) > target else (low, middle)
        if high - low < 1e-3 * high:
            break
    return (low + high) / 2
