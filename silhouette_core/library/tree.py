"""The silhouette tree: a library's samples divided again and again by how much their silhouettes
differ.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.distance import Target, Weighting
from silhouette_core.image.spans import Spans
from silhouette_core.library.rendering import masks_of
from silhouette_core.progress import Reporter

# sets of at least this many samples are scored by all threads together, smaller ones by one thread
# each
_ALONE = 2048


@dataclass(frozen=True, eq=False)
class Poses:
    """Where samples are in pose space.

    Attributes: angles: (B, D) joint angles of the base poses, radians. base: (N,) base pose of each
        sample. orientation: (N, 9) float64, the pelvis's, see
        `silhouette_core.library.transitions.turned_orientations`: its Euclidean distance
            is an angle in radians, so that turning the body by some degrees counts as turning one
            joint by as much.
    """

    angles: NDArray[np.float32]
    base: NDArray[np.int32]
    orientation: NDArray[np.float64]

    def nearest_to_mean(self, samples: NDArray[np.integer]) -> int:
        """Returns the sample nearest to the mean of `samples` (n,), over joint angles and
        orientation; of equally near ones the first.
        """
        if len(samples) < 2:
            return int(samples[0])
        found = np.zeros(len(samples))
        for values in (self.angles[self.base[samples]], self.orientation[samples]):
            values = values.astype(np.float64)
            found += ((values - values.mean(axis=0)) ** 2).sum(axis=1)
        return int(samples[np.argmin(found)])


class Distances(Protocol):
    """Something that knows how far a representative is from samples."""

    def __call__(
        self, representative: int, samples: NDArray[np.int64], threads: bool
    ) -> NDArray[np.float64]:
        """Returns the distances (n,) from a representative to `samples` (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class Scorer:
    """Distances between samples at one resolution.

    Attributes:
        spans: all samples' silhouettes.
        size_px: (width, height).
        weighting: of the distance; the weights are the representative's.
    """

    spans: Spans
    size_px: tuple[int, int]
    weighting: Weighting

    def __call__(
        self, representative: int, samples: NDArray[np.int64], threads: bool
    ) -> NDArray[np.float64]:
        """Returns the distances (n,) from a representative to `samples` (n,)."""
        mask = masks_of(self.spans, np.array([representative]), self.size_px)[0]
        return Target.of(mask, self.weighting).distances(self.spans, samples, threads=threads)


@dataclass(eq=False)
class Split:
    """Steps 1 to 3 on one set of n samples, as far as they have come.

    Attributes:
        samples: (n,) int64, rising.
        chosen: the representatives so far, places in `samples`.
        total: (n,) sum of the distances to them.
        nearest: (n,) least of the distances; nearest_node: (n,) whose.
    """

    samples: NDArray[np.int64]
    chosen: list[int]
    total: NDArray[np.float64]
    nearest: NDArray[np.float64]
    nearest_node: NDArray[np.int32]

    @classmethod
    def start(cls, samples: NDArray[np.int64], poses: Poses) -> Split:
        """Step 1: the first representative is the sample nearest the mean."""
        first = int(np.searchsorted(samples, poses.nearest_to_mean(samples)))
        count = len(samples)
        return cls(
            samples, [first], np.zeros(count), np.full(count, np.inf), np.zeros(count, np.int32)
        )

    def run(
        self,
        score: Distances,
        threshold: float,
        after: Callable[[Split], None] = lambda split: None,
        threads: bool = False,
    ) -> None:
        """Steps 2 and 3: takes the newest representative's distances, then chooses the next, until
        all samples are near one.

        A representative is scored against all samples and not only those still far from the others:
        a sample belongs to the nearest of all representatives, and that may be a later one.
        """
        while len(self.chosen) < len(self.samples):
            distance = score(int(self.samples[self.chosen[-1]]), self.samples, threads)
            self.total += distance
            nearer = distance < self.nearest
            self.nearest[nearer] = distance[nearer]
            self.nearest_node[nearer] = len(self.chosen) - 1
            far = np.flatnonzero(self.nearest > threshold)
            if not len(far):
                break
            self.chosen.append(int(far[np.argmax(self.total[far])]))
            after(self)
        self.nearest_node[self.chosen] = np.arange(len(self.chosen), dtype=np.int32)

    def groups(self) -> list[NDArray[np.int64]]:
        """Returns the samples of each new node, rising, in the order in which the nodes came up."""
        order = np.argsort(self.nearest_node, kind="stable")
        return np.split(
            self.samples[order],
            np.cumsum(np.bincount(self.nearest_node, minlength=len(self.chosen)))[:-1],
        )


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of one level.

    Attributes: representative: (K,) int32, samples. parent: (K,) int32. offsets: (K + 1,) int64 and
        members (N,) int32: the samples of node k are members[offsets[k] : offsets[k + 1]], rising.
    """

    representative: NDArray[np.int32]
    parent: NDArray[np.int32]
    offsets: NDArray[np.int64]
    members: NDArray[np.int32]

    def sets(self) -> list[NDArray[np.int64]]:
        """Returns the samples of each node."""
        return np.split(self.members.astype(np.int64), self.offsets[1:-1])

    @classmethod
    def of(cls, groups: list[list[NDArray[np.int64]]], poses: Poses) -> Nodes:
        """Step 4: re-chooses each node's representative as the sample nearest its mean.

        Args:
            groups: for every parent the samples of its children.
            poses: the pose space.
        """
        flat = [group for children in groups for group in children]
        parent = np.repeat(
            np.arange(len(groups), dtype=np.int32), [len(children) for children in groups]
        )
        offsets = np.cumsum([0] + [len(group) for group in flat]).astype(np.int64)
        representative = np.array([poses.nearest_to_mean(group) for group in flat], np.int32)
        return cls(representative, parent, offsets, np.concatenate(flat).astype(np.int32))


def divide(
    sets: list[NDArray[np.int64]],
    poses: Poses,
    score: Scorer,
    threshold: float,
    reporter: Reporter | None = None,
) -> list[list[NDArray[np.int64]]]:
    """Divides sets of samples, each by steps 1 to 3.

    Args:
        sets: the samples of every node of the level above, rising.
        poses: the pose space.
        score: silhouette distances at this level.
        threshold: T_l.
        reporter: told of every set.

    Returns:
        For every set the samples of its new nodes.

    Source: Okada and Stenger, section 3.
    """

    def one(samples: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        split = Split.start(samples, poses)
        split.run(score, threshold, threads=len(samples) >= _ALONE)
        if reporter is not None:
            reporter.advance()
        return split.groups()

    found: list[list[NDArray[np.int64]]] = [[] for _ in sets]
    small = [k for k, samples in enumerate(sets) if len(samples) < _ALONE]
    with ThreadPoolExecutor(numba.get_num_threads()) as pool:
        for k, groups in zip(small, pool.map(one, [sets[k] for k in small]), strict=True):
            found[k] = groups
    for k, samples in enumerate(sets):
        if len(samples) >= _ALONE:
            found[k] = one(samples)
    return found
