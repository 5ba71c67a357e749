"""Bayesian filtering over the tree of silhouettes: from the posterior of one frame to that of the
next.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from silhouette_core.filter.evidence import Alignment, Evidence
from silhouette_core.library.pose_library import PoseLibrary

SIGMA_SCALE = 2.5
"""Factor on the motion model's sigmas: beside a library's few dozens of neighbours the joint
angles' own are so narrow that a wrong turn could not be left again (with 54 angles, two samples
would hold nearly all of a transition)."""


@dataclass(frozen=True)
class FilterSettings:
    """How the filter believes and prunes.

    Attributes: sigma: standard deviation of the silhouette distance of a right pose, eq. (10), as a
        share of the silhouette's own weight. coarse: by how much sigma grows with every level above
        the last: a representative stands for its whole node there. survivors: share of the best
        node's posterior that a node must reach for its children to be scored. most: nodes per level
        that are kept at most. floor: share of the prior spread evenly over the library, so that a
        lost track recovers.
    """

    sigma: float = 0.07
    coarse: float = 1.5
    survivors: float = 1e-3
    most: int = 1500
    floor: float = 0.10


@dataclass(frozen=True, eq=False)
class Posterior:
    """What is believed after a frame. M samples of the surviving leaves, likeliest first.

    Attributes:
        samples: (M,) int64, numbers in the library.
        probability: (M,) float64, summing to 1.
        distance: (M,) float64, the silhouette distance of each sample's leaf.
        scale: (M,) int64, shift_px: (M, 2) int64, see `Alignment`.
        scored: nodes that were scored, per level.
    """

    samples: NDArray[np.int64]
    probability: NDArray[np.float64]
    distance: NDArray[np.float64]
    scale: NDArray[np.int64]
    shift_px: NDArray[np.int64]
    scored: tuple[int, ...]


class TreeFilter:
    """Tree-based filtering.

    Args: library: poses and their tree. transitions: (N, N) sparse, row i the distribution of the
        next pose after sample i, eq. (4) and (5). settings: see FilterSettings.

    Source: Okada and Stenger, section 6.
    """

    def __init__(
        self, library: PoseLibrary, transitions: csr_matrix, settings: FilterSettings | None = None
    ):
        """Prepares which samples hang on every node."""
        self.library = library
        self.settings = settings or FilterSettings()
        self.transitions = transitions
        # Children are stored together, in the order of their parents: where those of every node
        # begin.
        self._children = [
            np.searchsorted(level.parent, np.arange(len(above) + 1))
            for above, level in pairwise(library.levels)
        ]

    def predict(self, posterior: Posterior, steps: int = 1) -> NDArray[np.float64]:
        """Returns the prior (N,) of the next frame.

        Args:
            posterior: of this frame.
            steps: how many steps of the motion model lie between the frames.

        Source: Okada and Stenger, eq. (14), as a sparse product; the floor is ours.
        """
        # The first step starts from few samples: their rows alone are added up.
        rows = self.transitions[posterior.samples]
        sigma = rows.data * np.repeat(posterior.probability, np.diff(rows.indptr))
        belief = np.bincount(rows.indices, sigma, minlength=len(self.library))
        for _ in range(steps - 1):
            belief = self.transitions.T @ belief
        belief /= max(belief.sum(), 1e-300)
        return (1 - self.settings.floor) * belief + self.settings.floor / len(belief)

    def update(self, prior: NDArray[np.float64], evidence: Evidence) -> Posterior:
        """Finds the posterior of a frame.

        Args:
            prior: (N,) over the library's samples.
            evidence: the frame's silhouette.

        Source: Okada and Stenger, eq. (10) to (13).
        """
        library = self.library
        belief = self._of_nodes(prior)
        nodes = np.arange(len(library.levels[0]))
        scored = [len(nodes)]
        found, log_likelihood, kept = self._level(0, nodes, belief[0], evidence)
        for depth, first in enumerate(self._children, 1):
            nodes = _ranges(first[nodes[kept]], first[nodes[kept] + 1])
            scored.append(len(nodes))
            found, log_likelihood, kept = self._level(depth, nodes, belief[depth], evidence)
        # Within a leaf all poses look alike: its likelihood counts for each of its samples, with
        # the sample's own prior (12), (13).
        leaf = nodes[kept]
        counts = library.leaf_offsets[leaf + 1] - library.leaf_offsets[leaf]
        samples = library.leaf_samples[
            _ranges(library.leaf_offsets[leaf], library.leaf_offsets[leaf + 1])
        ]
        of_leaf = np.repeat(kept, counts)
        with np.errstate(divide="ignore"):
            log_posterior = log_likelihood[of_leaf] + np.log(prior[samples])
        probability = np.exp(log_posterior - log_posterior.max())
        probability /= probability.sum()
        order = np.argsort(-probability, kind="stable")
        of_leaf = of_leaf[order]
        return Posterior(
            samples[order].astype(np.int64),
            probability[order],
            found.distance[of_leaf],
            found.scale[of_leaf],
            found.shift_px[of_leaf],
            tuple(scored),
        )

    def _level(
        self, depth: int, nodes: NDArray[np.int64], belief: NDArray[np.float64], evidence: Evidence
    ) -> tuple[Alignment, NDArray[np.float64], NDArray[np.int64]]:
        """Scores nodes of a level: how they lie on the silhouette, their log likelihoods, and which
        (by place) survive.
        """
        settings, levels_below = self.settings, len(self.library.levels) - 1 - depth
        found = evidence.distances(self.library.levels[depth].spans, nodes, 2**levels_below)
        log_likelihood = (
            -0.5 * (found.distance / (settings.sigma * settings.coarse**levels_below)) ** 2
        )  # (10), (11)
        with np.errstate(divide="ignore"):
            log_posterior = log_likelihood + np.log(belief[nodes])
            kept = np.flatnonzero(log_posterior >= log_posterior.max() + np.log(settings.survivors))
        if len(kept) > settings.most:
            kept = np.sort(kept[np.argsort(-log_posterior[kept], kind="stable")[: settings.most]])
        return found, log_likelihood, kept

    def _of_nodes(self, prior: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Sums the samples' prior over the nodes of every level."""
        library = self.library
        sums = np.concatenate([[0.0], np.cumsum(prior[library.leaf_samples])])
        of_level = [sums[library.leaf_offsets[1:]] - sums[library.leaf_offsets[:-1]]]
        for level, above in zip(library.levels[:0:-1], library.levels[-2::-1], strict=True):
            of_level.insert(
                0, np.bincount(level.parent, of_level[0], minlength=len(above.representative))
            )
        return of_level


def _ranges(first: NDArray[np.integer], last: NDArray[np.integer]) -> NDArray[np.int64]:
    """Returns first[0] .. last[0] - 1, first[1] .. last[1] - 1, ... one after the other."""
    counts = (last - first).astype(np.int64)
    ends = np.cumsum(counts)
    return (
        np.arange(ends[-1] if len(ends) else 0)
        - np.repeat(ends - counts, counts)
        + np.repeat(first, counts)
    )
