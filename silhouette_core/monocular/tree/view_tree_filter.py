"""Bayesian filter over a library with a tree for every view: a sparse prior, a narrow search.

Nothing that is done for a frame looks at all samples: the motion model reads the neighbours of the
samples that are probable, all others share the floor of the prior view by view, and of every level
a bounded number of nodes is followed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from silhouette_core.monocular.tree.evidence import Evidence
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import WINDOW_PX
from silhouette_core.monocular.tree.transitions import NeighbourWeights, transitions
from silhouette_core.monocular.tree.tree_filter import (
    SIGMA_SCALE,
    FilterSettings,
    Posterior,
    TreeFilter,
    concatenated_ranges,
)
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU

FOLLOWED = (640, 2200, 3200)
"""Largest numbers of nodes of each level that are followed; of the last, that are aligned."""
_MOST_SAMPLES = 4096  # samples that stay in a prior of several steps
_LEAST_VIEW = 1e-3  # views of less weight, relative to the heaviest, are not scored at all


@dataclass(frozen=True, eq=False)
class SparsePrior:
    """Prior over N samples: M of them by themselves, and every sample by its view.

    Attributes:
        samples: (M,) int64, increasing.
        probability: (M,) float64, what is added for these samples.
        of_view: (V,) float64, probability of each sample of a view besides.
    """

    samples: NDArray[np.int64]
    probability: NDArray[np.float64]
    of_view: NDArray[np.float64]


class ViewTreeFilter(TreeFilter):
    """Filter over a pose library with a tree for every view.

    Args:
        library: poses and their trees; N samples, each a leaf.
        weights: what follows every sample.
        settings: parameters of likelihood and pruning; of `most`, `FOLLOWED` is the limit where it
            is less, of `moved` where it is more.
        backend: scores the nodes, and the poses of whoever follows what they lead to.

    Source: Okada and Stenger, section 6; the tree for every view is ours.
    """

    def __init__(
        self,
        library: PoseLibrary,
        weights: NeighbourWeights,
        settings: FilterSettings | None = None,
        backend: Backend = CPU,
    ):
        """Finds the node of every sample."""
        nothing = csr_matrix((len(library), len(library)), dtype=np.float32)
        settings = settings or FilterSettings()
        settings = replace(settings, moved=max(settings.moved, FOLLOWED[-1]))
        super().__init__(library, nothing, settings, backend)
        self.weights = weights
        first, second = library.levels[0], library.levels[1]
        self._leaf_of = np.empty(len(library), np.int32)
        self._leaf_of[library.leaf_samples] = np.arange(len(library), dtype=np.int32)
        self._view_of = [library.sample_view[level.representative] for level in (first, second)]
        below = np.diff(library.child_offsets[1])
        self._counts = [np.bincount(second.parent, below, len(first)), below.astype(np.float64)]

    def predict(  # type: ignore[override]
        self, posterior: Posterior, steps: int = 1
    ) -> SparsePrior:
        """Prior of the next frame, see `TreeFilter.predict`.

        Of several steps, only the 4,096 most probable samples are carried from one to the next.

        Args:
            posterior: posterior of this frame.
            steps: frame intervals between the frames.

        Source: Okada and Stenger, eq. (2), (14).
        """
        samples, probability = posterior.samples, posterior.probability
        for _ in range(steps):
            if len(samples) > _MOST_SAMPLES:
                kept = np.argpartition(-probability, _MOST_SAMPLES)[:_MOST_SAMPLES]
                samples, probability = samples[kept], probability[kept]
            targets, weights = self.weights.after(samples)
            flat, where = np.unique(targets.ravel(), return_inverse=True)
            terms = (weights * probability[:, None]).ravel()
            samples = flat.astype(np.int64)
            probability = np.bincount(where, terms, len(flat))  # eq. (2), (14)
        floor, views = self.settings.floor, len(self.library.views)
        probability *= (1 - floor) / max(probability.sum(), 1e-300)
        return SparsePrior(samples, probability, np.full(views, floor / len(self.library)))

    def spread(  # type: ignore[override]
        self, prior: SparsePrior | NDArray[np.float64], share: float
    ) -> SparsePrior:
        """See `TreeFilter.spread`."""
        if isinstance(prior, np.ndarray):
            return super().spread(prior, share)  # type: ignore[return-value]
        return SparsePrior(
            prior.samples,
            (1 - share) * prior.probability,
            (1 - share) * prior.of_view + share / len(self.library),
        )

    def weigh_views(  # type: ignore[override]
        self, prior: SparsePrior | NDArray[np.float64], weights: NDArray[np.float64]
    ) -> SparsePrior:
        """See `TreeFilter.weigh_views`."""
        if isinstance(prior, np.ndarray):
            return super().weigh_views(prior, weights)  # type: ignore[return-value]
        probability = prior.probability * weights[self.library.sample_view[prior.samples]]
        of_view = prior.of_view * weights
        poses = len(self.library.base_angles)
        total = max(float(probability.sum() + poses * of_view.sum()), 1e-300)
        return replace(prior, probability=probability / total, of_view=of_view / total)

    def update(self, prior: SparsePrior | NDArray[np.float64], evidence: Evidence) -> Posterior:
        """Posterior of a frame, see `TreeFilter.update`.

        Args:
            prior: over the library's samples; an array (N,) is for a first frame.
            evidence: the frame's silhouette.

        Returns:
            The samples whose leaves were scored and are probable.

        Source: Okada and Stenger, eq. (1), (10)-(13).
        """
        library, levels = self.library, self.library.levels
        of_nodes = self._priors(prior)
        nodes, scale = np.flatnonzero(of_nodes[0] > 0), None
        scored = []
        for depth in range(len(levels) - 1):
            scored.append(len(nodes))
            kept, scale = self._best(depth, nodes, of_nodes[depth][nodes], evidence, scale)
            first = library.child_offsets[depth]
            below, above = first[nodes[kept]], first[nodes[kept] + 1]
            nodes, scale = concatenated_ranges(below, above), np.repeat(scale, above - below)
        samples = library.leaf_samples[nodes].astype(np.int64)
        scored.append(len(nodes))
        of_samples = self.prior_of(prior, samples)
        kept, _ = self._best(len(levels) - 1, nodes, of_samples, evidence, scale)
        nodes, samples, of_samples = nodes[kept], samples[kept], of_samples[kept]
        alignment, log_likelihood, kept = self.score_level(
            len(levels) - 1, nodes, of_samples, evidence
        )
        with np.errstate(divide="ignore"):
            log_posterior = log_likelihood[kept] + np.log(of_samples[kept])  # eq. (12), (13)
        probability = np.exp(log_posterior - log_posterior.max())
        probability /= probability.sum()  # eq. (1): c_t
        order = np.argsort(-probability, kind="stable")
        rows = kept[order]
        return Posterior(
            samples[rows],
            probability[order],
            alignment.distance[rows],
            alignment.scale[rows],
            alignment.shift_px[rows],
            tuple(scored),
        )

    def _best(
        self,
        depth: int,
        nodes: NDArray[np.int64],
        node_prior: NDArray[np.float64],
        evidence: Evidence,
        scale: NDArray[np.int64] | None,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Positions of the likeliest of some nodes, increasing, and the numbers of their windows.

        The nodes are not moved: which of them are likely hardly depends on that.
        """
        level, levels_below = self.library.levels[depth], len(self.library.levels) - 1 - depth
        reduction = WINDOW_PX[0] // level.size_px[0]
        distance, scale = evidence.unmoved_distances(level.spans, nodes, reduction, scale)
        sigma = self.settings.sigma * self.settings.coarse**levels_below
        with np.errstate(divide="ignore"):
            log_posterior = -0.5 * (distance / sigma) ** 2 + np.log(node_prior)  # eq. (10), (11)
        kept = np.arange(len(nodes))
        if len(nodes) > FOLLOWED[depth]:
            kept = np.sort(np.argpartition(-log_posterior, FOLLOWED[depth])[: FOLLOWED[depth]])
        return kept, scale[kept]

    def _priors(
        self, prior: SparsePrior | NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Prior of all nodes of the first and the second level."""
        first, second = self.library.levels[:2]
        if isinstance(prior, np.ndarray):
            below = np.add.reduceat(
                prior[self.library.leaf_samples], self.library.child_offsets[1][:-1]
            )
            return np.bincount(second.parent, below, len(first)).astype(float), below
        least = _LEAST_VIEW * prior.of_view.max()
        of_view = np.where(prior.of_view >= least, prior.of_view, 0.0)
        leaf = self._leaf_of[prior.samples]
        node = self.library.levels[2].parent[leaf]
        own = np.bincount(node, prior.probability, len(second))
        of_second = own + of_view[self._view_of[1]] * self._counts[1]
        of_first = np.bincount(second.parent[node], prior.probability, len(first))
        return of_first + of_view[self._view_of[0]] * self._counts[0], of_second

    def prior_of(
        self, prior: SparsePrior | NDArray[np.float64], samples: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Prior (n,) float64 of some samples (n,)."""
        if isinstance(prior, np.ndarray):
            return prior[samples]
        result = prior.of_view[self.library.sample_view[samples]]
        if len(prior.samples):
            at = np.minimum(np.searchsorted(prior.samples, samples), len(prior.samples) - 1)
            result = result + np.where(prior.samples[at] == samples, prior.probability[at], 0.0)
        return result


def tree_filter(
    library: PoseLibrary, occlusion_aware: bool, interval_s: float, backend: Backend = CPU
) -> TreeFilter:
    """Filter over a library, whichever tree it has.

    Args:
        library: the library.
        occlusion_aware: motion model DM2; else DM1.
        interval_s: time between two frames, s.
        backend: scores the nodes.
    """
    if library.settings.tree == "views":
        weights = NeighbourWeights(library, occlusion_aware, SIGMA_SCALE, interval_s)
        return ViewTreeFilter(library, weights, backend=backend)
    matrix = transitions(library, occlusion_aware, SIGMA_SCALE, interval_s=interval_s)
    return TreeFilter(library, matrix, backend=backend)
