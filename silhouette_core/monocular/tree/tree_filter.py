"""Bayesian filter over the silhouette tree: from the posterior of a frame to that of the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from silhouette_core.monocular.tree.evidence import UNMOVED, Alignment, Evidence
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import WINDOW_PX
from silhouette_core.monocular.tuning import FILTER, FilterSettings
from silhouette_core.ranking import rounded
from silhouette_core.scoring.backend import Backend


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of a frame: M samples of the surviving leaves, likeliest first.

    Attributes:
        samples: (M,) int64, indices into the library.
        probability: (M,) float64, summing to 1.
        distance: (M,) float64, the silhouette distance of each sample's leaf.
        scale: (M,) int64, index of the window of the least distance, see `Alignment`.
        shift_px: (M, 2) int64, shift (right, down) of the least distance, see `Alignment`.
        scored: number of nodes scored, per level.
    """

    samples: NDArray[np.int64]
    probability: NDArray[np.float64]
    distance: NDArray[np.float64]
    scale: NDArray[np.int64]
    shift_px: NDArray[np.int64]
    scored: tuple[int, ...]


class TreeFilter:
    """Tree-based filter over a pose library.

    Args:
        library: poses and their tree; N samples.
        transitions: (N, N) sparse, row i is the distribution of the pose after sample i, see
            `silhouette_core.monocular.tree.transitions.transitions`.
        backend: scores the nodes, and the poses of whoever follows what they lead to.

    Source: Okada and Stenger, section 6; `PaperFilter` states the equations.
    """

    def __init__(
        self,
        library: PoseLibrary,
        transitions: csr_matrix,
        backend: Backend,
        settings: FilterSettings = FILTER,
    ):
        self.library, self.transitions = library, transitions
        self.settings, self.backend = settings, backend

    def predict(self, posterior: Posterior, steps: int = 1) -> NDArray[np.float64]:
        """Prior of the next frame, eq. (14): a product with the sparse matrix of transitions, of
        the samples that survived only, and a floor of even probability, which the paper lacks.

        Args:
            steps: frame intervals between the frames: the variance of the random walk grows with
                every one.

        Returns:
            (N,) float64, summing to 1.

        Source: Okada and Stenger, eq. (2), (14); several steps and the floor are ours.
        """
        # The first step starts from few samples: only their rows are summed.
        rows = self.transitions[posterior.samples]
        terms = rows.data * np.repeat(posterior.probability, np.diff(rows.indptr))
        prior = np.bincount(rows.indices, terms, minlength=len(self.library))  # eq. (2), (14)
        for _ in range(steps - 1):
            prior = self.transitions.T @ prior
        prior /= max(prior.sum(), 1e-300)
        return (1 - self.settings.floor) * prior + self.settings.floor / len(prior)

    def weigh_views(
        self, prior: NDArray[np.float64], weights: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Prior (N,) float64 times the weight of every sample's view (V,), summing to 1 again."""
        prior = prior * weights[self.library.sample_view]
        return prior / prior.sum()

    def update(self, prior: NDArray[np.float64], evidence: Evidence) -> Posterior:
        """Posterior of a frame, eq. (1): the tree is descended level by level, see `score_level`.

        Args:
            prior: (N,) float64, over the library's samples.

        Returns:
            The samples of the surviving leaves; all others have probability 0.

        Source: Okada and Stenger, eq. (1), (12), (13).
        """
        library = self.library
        node_prior = node_sums(library, prior)
        nodes = np.arange(len(library.levels[0]))
        scored = [len(nodes)]
        alignment, log_likelihood, kept = self.score_level(0, nodes, node_prior[0][nodes], evidence)
        for depth, first in enumerate(library.child_offsets[:-1], 1):
            nodes = concatenated_ranges(first[nodes[kept]], first[nodes[kept] + 1])
            scored.append(len(nodes))
            alignment, log_likelihood, kept = self.score_level(
                depth, nodes, node_prior[depth][nodes], evidence
            )
        samples, number = samples_of(library, nodes[kept])
        of_leaf = kept[number]
        with np.errstate(divide="ignore"):  # eq. (12), (13)
            log_posterior = rounded(log_likelihood[of_leaf] + np.log(prior[samples]))
        probability = np.exp(log_posterior - log_posterior.max())
        probability /= probability.sum()  # eq. (1): c_t
        order = np.argsort(-log_posterior, kind="stable")
        of_leaf = of_leaf[order]
        return Posterior(
            samples[order].astype(np.int64),
            probability[order],
            alignment.distance[of_leaf],
            alignment.scale[of_leaf],
            alignment.shift_px[of_leaf],
            tuple(scored),
        )

    def score_level(
        self,
        depth: int,
        nodes: NDArray[np.int64],
        node_prior: NDArray[np.float64],
        evidence: Evidence,
    ) -> tuple[Alignment, NDArray[np.float64], NDArray[np.int64]]:
        r"""Likelihood of nodes of one level, eq. (10), (11), and which of them survive.

        The distance is relative to the observation's own weight (see `relative_weights`), and
        :math:`\sigma` grows with every level above the last, which the paper does not say.

        Args:
            depth: 0 for the coarsest level.
            nodes: (K,) int64, indices of the nodes to be scored.
            node_prior: (K,) float64, prior of these nodes.

        Returns:
            Alignments of the K nodes, their log likelihoods (K,) float64 without the constant
            factor, and the positions (n,) int64 of the survivors among them.

        Source: Okada and Stenger, eq. (10), (11).
        """
        settings, levels_below = self.settings, len(self.library.levels) - 1 - depth
        level = self.library.levels[depth]
        reduction = WINDOW_PX[0] // level.size_px[0]
        sigma = settings.sigma * settings.coarse**levels_below
        with np.errstate(divide="ignore"):
            log_prior, least = np.log(node_prior), np.log(settings.survivors)
        if len(nodes) <= 2 * settings.moved:
            alignment = evidence.distances(level.spans, nodes, reduction)
        else:
            unmoved = evidence.distances(level.spans, nodes, reduction, UNMOVED)
            likely = rounded(0.5 * (unmoved.distance / sigma) ** 2 - log_prior)
            moved = np.sort(np.argpartition(likely, settings.moved)[: settings.moved])
            alignment = evidence.distances(level.spans, nodes[moved], reduction)
            alignment = alignment.among(moved, unmoved)
        log_likelihood = -0.5 * (alignment.distance / sigma) ** 2  # eq. (10), (11)
        log_posterior = rounded(log_likelihood + log_prior)
        kept = np.flatnonzero(log_posterior >= log_posterior.max() + least)
        if len(kept) > settings.most:
            kept = np.sort(kept[np.argsort(-log_posterior[kept], kind="stable")[: settings.most]])
        return alignment, log_likelihood, kept


def node_sums(library: PoseLibrary, prior: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Prior (K, …) of the nodes of every level: the sums over their samples, of a prior (N, …)."""
    sums = [np.add.reduceat(prior[library.leaf_samples], library.leaf_offsets[:-1])]
    for offsets in library.child_offsets[-2::-1]:
        sums.insert(0, np.add.reduceat(sums[0], offsets[:-1]))
    return sums


def samples_of(
    library: PoseLibrary, leaves: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Samples (M,) of some leaves (n,), leaf by leaf, and the number of each in that order (M,)."""
    ends = library.leaf_offsets[leaves], library.leaf_offsets[leaves + 1]
    samples = library.leaf_samples[concatenated_ranges(*ends)].astype(np.int64)
    return samples, np.repeat(np.arange(len(leaves)), ends[1] - ends[0])


def concatenated_ranges(first: NDArray[np.integer], last: NDArray[np.integer]) -> NDArray[np.int64]:
    """Concatenated ranges first[0] .. last[0] - 1, first[1] .. last[1] - 1, ..."""
    counts = (last - first).astype(np.int64)
    ends = np.cumsum(counts)
    return (
        np.arange(ends[-1] if len(ends) else 0)
        - np.repeat(ends - counts, counts)
        + np.repeat(first, counts)
    )
