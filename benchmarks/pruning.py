"""How well a tree leads to the pose that fits best: `python -m benchmarks.pruning LIBRARY.vplib`.

Trees of the same size are made with each weighting from a sixth of the library's base poses;
silhouettes of other base poses are looked
up in them. Printed per weighting of the tree: the rank, among the first level's nodes, of the one
that holds the sample that fits best of all (median, 90th and 97th percentile, as shares of the
nodes), and how much worse than that one the sample found is when only the best 5 % of each level's
nodes are followed (mean ratio of the distances).
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from silhouette_core.image.spans import Spans
from silhouette_core.monocular.making.base_poses import BasePoses
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import (
    pose_surfaces,
    render_views,
    silhouette_levels,
    spans_of,
)
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.scoring.cpu import CPU
from silhouette_core.scoring.target import Target

_EVERY, _TESTS, _FOLLOWED = 6, 120, 0.05


def main(path: str) -> None:
    """Prints the table."""
    whole = read_library(Path(path))
    some = np.arange(0, len(whole.base_angles), _EVERY)
    observed, spans = _observations(whole, some), None
    for weighting in ("nwxor", "balanced", "xor"):
        library = build_library(
            _bases(whole, some), whole.model, replace(whole.settings, weighting=weighting)
        )
        if spans is None:  # the same samples in every tree
            spans = spans_of(
                np.concatenate(
                    [
                        library.render(part).windows > 0
                        for part in np.array_split(np.arange(len(library)), 20)
                    ]
                )
            )
        nodes = np.empty(len(library), np.int64)
        nodes[library.leaf_samples] = np.repeat(
            np.arange(len(library.levels[-1])), np.diff(library.leaf_offsets)
        )
        for looked_up in ("nwxor", "balanced"):
            result = [
                _look_up(
                    library,
                    [Target.from_mask(mask, looked_up, library.bounds_px) for mask in masks],
                    spans,
                    nodes,
                )
                for masks in zip(*observed, strict=True)
            ]
            ranks, ratios = np.array(result).T
            shares = ", ".join(f"{share:.3f}" for share in np.percentile(ranks, (50, 90, 97)))
            print(
                f"tree {weighting:<9} look-up {looked_up:<9} rank {shares}   distance"
                f" {ratios.mean():.3f} times the least",
                flush=True,
            )


def _bases(whole: PoseLibrary, some: np.ndarray) -> BasePoses:
    return BasePoses(
        whole.base_angles[some],
        whole.base_quaternion[some],
        whole.base_source[some],
        whole.base_mirrored[some],
        whole.clips,
        0.0,
        len(some),
        whole.sigma_rad,
        whole.root_sigma_rad,
    )


def _observations(whole: PoseLibrary, some: np.ndarray) -> tuple[np.ndarray, ...]:
    """Silhouettes of base poses that the trees do not hold, from any side."""
    others = np.setdiff1d(np.arange(3, len(whole.base_angles), 17), some)[:_TESTS]
    surfaces, _ = pose_surfaces(
        whole.model, whole.base_quaternion[others], whole.base_angles[others]
    )
    yaw = np.random.default_rng(0).uniform(0, 2 * np.pi, len(others))
    views = np.column_stack([yaw, np.full(len(others), whole.views[0, 1])])
    return silhouette_levels(
        render_views(whole.model, surfaces, np.arange(len(others)), views).windows > 0
    )


def _look_up(
    library: PoseLibrary, targets: list[Target], spans: Spans, nodes: np.ndarray
) -> tuple[float, float]:
    every = CPU.span_distances(targets[-1], spans)[:, 0]
    best = int(every.argmin())
    distances = [
        CPU.span_distances(target, level.spans)[:, 0]
        for target, level in zip(targets, library.levels, strict=True)
    ]
    right = library.levels[1].parent[library.levels[2].parent[nodes[best]]]
    kept = np.arange(len(library.levels[0]))
    for distance, level, below in zip(
        distances, library.levels, (*library.levels[1:], None), strict=False
    ):
        kept = kept[np.argsort(distance[kept])[: max(1, int(_FOLLOWED * len(level)))]]
        if below is not None:
            kept = np.flatnonzero(np.isin(below.parent, kept))
    leaf = library.leaf_samples[library.leaf_offsets[kept[0]] : library.leaf_offsets[kept[0] + 1]]
    return float((distances[0] < distances[0][right]).mean()), float(
        every[leaf].mean() / every[best]
    )


if __name__ == "__main__":
    main(sys.argv[1])
