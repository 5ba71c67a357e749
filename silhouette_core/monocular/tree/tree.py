"""Silhouette tree: a library's samples divided recursively by their silhouette distances."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numba
import numpy as np
from numpy.typing import NDArray

from calib.checks import Float32Array, FloatArray, IndexArray, IntArray
from silhouette_core.image.spans import Rectangle, Spans
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import masks_of
from silhouette_core.progress import Reporter, SilentReporter
from silhouette_core.scoring.backend import Target
from silhouette_core.scoring.cpu import CpuBackend

# Larger sets are scored by all threads together, smaller ones by one thread each.
_LARGE = 2048
_DRAWN = 128  # representatives whose distances tell how those of two kinds compare


@dataclass(frozen=True, eq=False)
class PoseSpace:
    """Coordinates of N samples in pose space."""

    angles: Float32Array  #: (B, D) float32, joint angles of the base poses, radians.
    base: NDArray[np.int32]  #: (N,) int32, base pose of each sample.
    orientation: FloatArray
    """(N, 9) float64, the pelvis's, see
    `silhouette_core.monocular.tree.transitions.view_orientations`: its Euclidean distance is an
    angle in radians, so that turning the body by some degrees counts as turning one joint by as
    much."""

    def nearest_to_mean(self, samples: IndexArray) -> int:
        """Sample nearest to the mean of `samples` (n,) in joint angles and orientation.

        Of equally near samples it is the first.
        """
        if len(samples) < 2:
            return int(samples[0])
        squares = np.zeros(len(samples))
        for values in (self.angles[self.base[samples]], self.orientation[samples]):
            values = values.astype(np.float64)
            squares += ((values - values.mean(axis=0)) ** 2).sum(axis=1)
        # Of two samples both are as near: rounding must not choose.
        return int(samples[np.argmin(np.round(squares, 9))])


Distances = Callable[[int, IntArray, bool], FloatArray]
"""Distances (n,) of a representative from samples (n,), and whether all threads may work."""


@dataclass(frozen=True, eq=False)
class Scorer:
    """Distances between samples at one resolution."""

    spans: Spans  #: all samples' silhouettes.
    size_px: tuple[int, int]  #: (width, height).
    settings: LibrarySettings  #: weigh the pixels of the representative's silhouette.
    bounds_px: Rectangle  #: rectangle of the library, see `PoseLibrary`.

    def __call__(self, representative: int, samples: IntArray, threads: bool) -> FloatArray:
        """Returns the distances (n,) from a representative to `samples` (n,)."""
        mask = masks_of(self.spans, np.array([representative]), self.size_px)[0]
        weights = self.settings.weights(mask, self.bounds_px)
        target = Target((mask,), (weights,), scale=1 / mask.size)
        # Not what a command chooses: a library is the same whatever scores with it.
        scored = CpuBackend().span_distances(target, self.spans, samples, parallel=threads)
        return scored[:, 0]

    def threshold(self, by_xor: float) -> float:
        """Largest distance of as many pairs of samples as are within `by_xor` by XOR: one rule for
        all weightings, so that their trees have about the same shares of nodes.
        """
        if self.settings.weighting == "xor":
            return by_xor
        everybody = np.arange(len(self.spans), dtype=np.int64)
        drawn = np.random.default_rng(0).permutation(everybody)[:_DRAWN].tolist()
        xor_scorer = replace(self, settings=replace(self.settings, weighting="xor"))
        weighted, xor = (
            np.concatenate([score(first, everybody, True) for first in drawn])
            for score in (self, xor_scorer)
        )
        within = np.count_nonzero(xor <= by_xor) - 1  # at least every one from itself
        return float(np.partition(weighted, within)[within])


@dataclass(eq=False)
class Split:
    """State of the division of one set of n samples, steps (1) to (3)."""

    samples: IntArray  #: (n,) int64, increasing.
    chosen: list[int]  #: positions of the representatives in `samples`.
    total: FloatArray  #: (n,) float64, sum of the distances from all representatives.
    nearest: FloatArray  #: (n,) float64, distance from the nearest representative.
    nearest_node: NDArray[np.int32]  #: (n,) int32, index of the nearest representative.

    @classmethod
    def start(cls, samples: IntArray, poses: PoseSpace) -> "Split":
        r"""Division with its first representative.

        Step (1): the representative of the first node is the sample nearest to the mean of the set
        :math:`S` of samples in pose space,

        .. math::
            :label: okada-step-1

            r_1 = \arg\min_{x \in S} \|x - \mu(S)\|,
            \qquad \mu(S) = \frac{1}{|S|} \sum_{x \in S} x

        Args:
            samples: (n,) int64, increasing, the set :math:`S`.

        Source: Okada and Stenger, section 3.
        """
        first = int(np.searchsorted(samples, poses.nearest_to_mean(samples)))  # step (1)
        count = len(samples)
        return cls(
            samples, [first], np.zeros(count), np.full(count, np.inf), np.zeros(count, np.int32)
        )

    def run(
        self,
        score: Distances,
        threshold: float,
        after: Callable[[], None] = lambda: None,
        threads: bool = False,
    ) -> None:
        r"""Completes the division.

        Step (2): among the samples farther than :math:`T_l` from all :math:`k` representatives
        :math:`r_i` so far, the one of the largest mean distance becomes the next, until there is
        none,

        .. math::
            :label: okada-step-2

            r_{k+1} = \arg\max_{x \in F_k} \frac{1}{k} \sum_{i=1}^k d_{sil}(r_i, x),
            \qquad F_k = \{x \in S : \min_{i \le k} d_{sil}(r_i, x) > T_l\}

        Step (3): every other sample joins its nearest representative,

        .. math::
            :label: okada-step-3

            S_j = \{x \in S : j = \arg\min_i d_{sil}(r_i, x)\}

        A representative is compared with all samples, and not only with those still far from the
        others, since it may be the nearest of any.

        Args:
            score: silhouette distances :math:`d_{sil}` at this level.
            threshold: :math:`T_l`, in units of the distance.
            after: called after every new representative.
            threads: whether a representative is compared by all threads together.

        Source: Okada and Stenger, section 3.
        """
        while len(self.chosen) < len(self.samples):
            distance = score(int(self.samples[self.chosen[-1]]), self.samples, threads)
            self.total += distance
            nearer = distance < self.nearest
            self.nearest[nearer] = distance[nearer]
            self.nearest_node[nearer] = len(self.chosen) - 1  # step (3)
            far = np.flatnonzero(self.nearest > threshold)
            if not len(far):
                break
            self.chosen.append(int(far[np.argmax(self.total[far])]))  # step (2)
            after()
        self.nearest_node[self.chosen] = np.arange(len(self.chosen), dtype=np.int32)

    def groups(self) -> list[IntArray]:
        """Samples of each new node, increasing, in the order in which the nodes were created."""
        order = np.argsort(self.nearest_node, kind="stable")
        return np.split(
            self.samples[order],
            np.cumsum(np.bincount(self.nearest_node, minlength=len(self.chosen)))[:-1],
        )


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of one level, K of them."""

    representative: NDArray[np.int32]  #: (K,) int32, sample that represents the node.
    parent: NDArray[np.int32]  #: (K,) int32, node of the level above.
    offsets: IntArray  #: (K + 1,) int64; node k has the members offsets[k] to offsets[k + 1] - 1.
    members: NDArray[np.int32]  #: (N,) int32, samples of all nodes, increasing within a node.

    def sets(self) -> list[IntArray]:
        """Samples of each node."""
        return np.split(self.members.astype(np.int64), self.offsets[1:-1])

    @classmethod
    def from_groups(cls, groups: list[list[IntArray]], poses: PoseSpace) -> "Nodes":
        r"""Nodes of divided sets, with representatives chosen again.

        Step (4): the representative of a node is the sample nearest to the mean of its set
        :math:`S_j` in pose space,

        .. math::
            :label: okada-step-4

            \bar{x}_j = \arg\min_{x \in S_j} \|x - \mu(S_j)\|

        Args:
            groups: for every parent the samples of its children.

        Source: Okada and Stenger, section 3.
        """
        flat = [group for children in groups for group in children]
        parent = np.repeat(
            np.arange(len(groups), dtype=np.int32), [len(children) for children in groups]
        )
        offsets = np.cumsum([0] + [len(group) for group in flat]).astype(np.int64)
        representative = np.array(
            [poses.nearest_to_mean(group) for group in flat],  # step (4)
            np.int32,
        )
        return cls(representative, parent, offsets, np.concatenate(flat).astype(np.int32))


def divide(
    sets: list[IntArray],
    poses: PoseSpace,
    score: Scorer,
    threshold: float,
    reporter: Reporter | None = None,
) -> list[list[IntArray]]:
    """Division of sets of samples, each by steps (1) to (3), see `Split`.

    Args:
        sets: the samples of every node of the level above, increasing.
        threshold: T_l.

    Returns:
        For every set the samples of its new nodes.

    Source: Okada and Stenger, section 3.
    """

    reporter = reporter or SilentReporter()
    one = len(sets) == 1  # then its representatives are counted, and else the sets

    def divided(samples: IntArray) -> list[IntArray]:
        split = Split.start(samples, poses)
        after = reporter.advance if one else lambda: None
        split.run(score, threshold, after, threads=len(samples) >= _LARGE)
        if not one:
            reporter.advance()
        return split.groups()

    result: list[list[IntArray]] = [[] for _ in sets]
    small = [k for k, samples in enumerate(sets) if len(samples) < _LARGE]
    with ThreadPoolExecutor(numba.get_num_threads()) as pool:
        for k, groups in zip(small, pool.map(divided, [sets[k] for k in small]), strict=True):
            result[k] = groups
    for k, samples in enumerate(sets):
        if len(samples) >= _LARGE:
            result[k] = divided(samples)
    return result
