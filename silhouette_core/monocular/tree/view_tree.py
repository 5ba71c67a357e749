"""Subtrees of a library by view: the samples of one view, divided twice by their silhouettes.

All samples of a view show different poses from one side. They are divided into a fixed number of
nodes, and each of these into nodes of about equal numbers of samples, which are the leaves: a
division does not see other views, so that views are divided independently of each other, and the
cost grows with the number of samples and not with its square.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.spans import Spans
from silhouette_core.monocular.tree.rendering import masks_of
from silhouette_core.scoring.cpu import CPU
from silhouette_core.scoring.target import Target

FIRST_NODES = 144
"""Number of nodes of the first level of a view, if it has so many samples."""
_ROUNDS = 2  # how often nodes and their medoids are found again
_DRAWN = 4096  # silhouettes drawn at a time


@dataclass(frozen=True, eq=False)
class ViewNodes:
    """Two levels of nodes over the n samples of a view.

    Attributes:
        order: (n,) int32, samples in the order of the nodes of the second level.
        first: (K,) int32, samples that represent the nodes of the first level.
        second: (L,) int32, samples that represent the nodes of the second level.
        parent: (L,) int32, node of the first level.
        offsets: (L + 1,) int64; node k of the second level has the samples order[offsets[k]] to
            order[offsets[k + 1] - 1].
        radius: largest distance of a sample from its node, at either level, as a fraction of the
            window.
    """

    order: NDArray[np.int32]
    first: NDArray[np.int32]
    second: NDArray[np.int32]
    parent: NDArray[np.int32]
    offsets: NDArray[np.int64]
    radius: tuple[float, float]


def divide_view(
    spans: Spans, size_px: tuple[int, int], first_nodes: int = FIRST_NODES
) -> ViewNodes:
    """Divides the samples of a view.

    Args:
        spans: silhouettes of the n samples.
        size_px: (width, height) of their images.
        first_nodes: number of nodes of the first level.

    Returns:
        Nodes of which every one has a sample at least. A node of the second level has about as many
        samples as a node of the first level has nodes.

    Source: own; the levels of Okada and Stenger, section 3, divide by a largest distance, which
        needs every representative to be compared with every sample of the library.
    """
    everybody = np.arange(len(spans), dtype=np.int64)
    groups, medoids, radius = group_by_medoids(everybody, first_nodes, spans, size_px)
    samples_of_node = max(1.0, np.sqrt(len(spans) / max(len(groups), 1)))
    leaves: list[NDArray[np.int64]] = []
    second: list[int] = []
    parent: list[int] = []
    farthest = 0.0
    for node, group in enumerate(groups):
        count = max(1, round(len(group) / samples_of_node))
        parts, own, within = group_by_medoids(group, count, spans, size_px)
        leaves += parts
        second += own
        parent += [node] * len(parts)
        farthest = max(farthest, within)
    return ViewNodes(
        np.concatenate(leaves).astype(np.int32),
        np.array(medoids, np.int32),
        np.array(second, np.int32),
        np.array(parent, np.int32),
        np.cumsum([0] + [len(leaf) for leaf in leaves]).astype(np.int64),
        (radius, farthest),
    )


def group_by_medoids(
    samples: NDArray[np.int64], count: int, spans: Spans, size_px: tuple[int, int]
) -> tuple[list[NDArray[np.int64]], list[int], float]:
    r"""Groups of samples about medoids, in the distance XOR.

    Medoids are first taken evenly from the list, then found again as the samples of least mean
    distance from the others of their group. A mean distance is a distance itself,

    .. math::
        \frac{1}{|S|} \sum_{y \in S} d(x, y)
        = c + \sum_p |1 - 2 m_p| \, [x_p \neq (m_p > \tfrac12)]

    from the majority of the group's silhouettes, where :math:`m_p` is the share of them that covers
    pixel :math:`p`.

    Args:
        samples: (n,) int64, numbers of silhouettes in `spans`.
        count: number of groups, at most.
        spans: silhouettes.
        size_px: (width, height) of their images.

    Returns:
        The samples of every group, increasing; the medoids; and the largest distance of a sample
        from its medoid.

    Source: the assignment and update of Lloyd's algorithm, as k-medoids.
    """
    count = min(count, len(samples))
    medoids = samples[(2 * np.arange(count) + 1) * len(samples) // (2 * count)]
    nearest, distance = _nearest(medoids, samples, spans, size_px)
    for _ in range(_ROUNDS if count < len(samples) else 0):
        medoids = np.array(
            [_medoid(samples[nearest == k], spans, size_px) for k in np.unique(nearest)], np.int64
        )
        nearest, distance = _nearest(medoids, samples, spans, size_px)
    kept = np.unique(nearest)
    groups = [samples[nearest == k] for k in kept]
    return groups, [int(medoids[k]) for k in kept], float(distance.max(initial=0.0))


def _nearest(
    medoids: NDArray[np.int64], samples: NDArray[np.int64], spans: Spans, size_px: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Number of the nearest medoid of every sample, and its distance."""
    nearest = np.zeros(len(samples), np.int64)
    least = np.full(len(samples), np.inf)
    for number, mask in enumerate(masks_of(spans, medoids, size_px)):
        distance = CPU.span_distances(Target.from_mask(mask, "xor"), spans, samples)[:, 0]
        nearer = distance < least
        nearest[nearer], least[nearer] = number, distance[nearer]
    return nearest, least


def _medoid(samples: NDArray[np.int64], spans: Spans, size_px: tuple[int, int]) -> int:
    """Sample of least mean distance from all."""
    if len(samples) < 3:
        return int(samples[0])
    covered = np.zeros(size_px[::-1], np.int64)
    for start in range(0, len(samples), _DRAWN):
        covered += masks_of(spans, samples[start : start + _DRAWN], size_px).sum(axis=0)
    weights = np.abs(2 * covered - len(samples)).astype(np.float64)
    majority = Target((2 * covered > len(samples),), (weights,))
    return int(samples[CPU.span_distances(majority, spans, samples)[:, 0].argmin()])
