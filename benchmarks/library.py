"""Library pictures and the silhouette distances between them: runs against images."""

from functools import cache

import numpy as np

from benchmarks.cases import Case, Timed, case
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.spans import Spans
from silhouette_core.jit import parallel_kernel, prange
from silhouette_core.monocular.tree.pose_library import LibrarySettings, nwxor_weights
from silhouette_core.monocular.tree.rendering import pose_surfaces, render_views, silhouette_levels
from silhouette_core.monocular.tree.tree import PoseSpace, Scorer, Split
from silhouette_core.scoring.backend import Target
from silhouette_core.scoring.cpu import CpuBackend

_POSES, _VIEWS = 84, 24
_WINDOW = 0, 0, 320, 240


@parallel_kernel
def _disagreement(mask, silhouettes, weights, distances):
    for k in prange(len(distances)):
        total = 0.0
        for y in range(mask.shape[0]):
            for x in range(mask.shape[1]):
                if mask[y, x] != silhouettes[k, y, x]:
                    total += weights[y, x]
        distances[k] = total


def dense_distances(mask: np.ndarray, silhouettes: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Distances (K,) of silhouettes (K, h, w) from a mask (h, w): eq. (7), every pixel."""
    distances = np.empty(len(silhouettes))
    _disagreement(mask, silhouettes, weights, distances)
    return distances / mask.size


@cache
def _masks() -> tuple[np.ndarray, ...]:
    """About 2,000 silhouettes of made-up poses from all sides, at the three resolutions."""
    model, rng = BodyModel.from_sizes(BodySizes(1.75)), np.random.default_rng(0)
    low, high = model.tree.dof_limits_rad.T
    angles = np.where(
        model.tree.dof_fixed, 0, np.clip(rng.normal(0, 0.4, (_POSES, model.dof_count)), low, high)
    )
    surfaces = pose_surfaces(model, np.tile([1.0, 0, 0, 0], (_POSES, 1)), angles)
    views = np.column_stack(
        [np.radians(np.tile(np.arange(_VIEWS) * 15, _POSES)), np.full(_POSES * _VIEWS, 0.1)]
    )
    base = np.repeat(np.arange(_POSES), _VIEWS)
    windows = [
        render_views(model, surfaces, base[k : k + 480], views[k : k + 480]).windows
        for k in range(0, len(base), 480)
    ]
    return silhouette_levels(np.concatenate(windows) > 0)


def _score(level: int, dense: Timed, name: str, goal: str = "") -> Case:
    masks = _masks()[level]
    weights, spans = nwxor_weights(masks[0], _WINDOW), Spans.from_masks(masks)
    target = Target((masks[0],), (weights,), scale=1 / masks[0].size)
    every = np.arange(len(spans))
    ours = Timed(lambda _: CpuBackend().span_distances(target, spans, every)[:, 0], repeats=20)
    return Case(
        ours,
        dense,
        name,
        lambda a, b: "" if np.allclose(a, b, rtol=1e-6, atol=1e-8) else "the results differ",
        goal=goal,
    )


@case("nwXOR of 2016 poses, 320 x 240, NumPy")
def against_numpy() -> Case:
    masks = _masks()[2]
    weights = nwxor_weights(masks[0], _WINDOW)
    dense = Timed(
        lambda _: (
            np.array([weights[masks[0] ^ one].sum(dtype=np.float64) for one in masks])
            / masks[0].size
        )
    )
    return _score(2, dense, "NumPy's weighted XOR", ">= 100")


@case("nwXOR of 2016 poses, 320 x 240, dense")
def against_dense() -> Case:
    masks = _masks()[2]
    weights = nwxor_weights(masks[0], _WINDOW)
    return _score(
        2,
        Timed(lambda _: dense_distances(masks[0], masks, weights)),
        "the same pixel by pixel, compiled",
    )


@case("nwXOR of 2016 poses, 80 x 60, dense")
def against_dense_small() -> Case:
    masks = _masks()[0]
    weights = nwxor_weights(masks[0], _WINDOW)
    return _score(
        0,
        Timed(lambda _: dense_distances(masks[0], masks, weights)),
        "the same pixel by pixel, compiled",
    )


@case("tree, level 1 of 2016 poses")
def first_level() -> Case:
    masks = _masks()[0]
    samples = np.arange(len(masks), dtype=np.int64)
    angles = np.zeros((1, 1), np.float32)
    poses = PoseSpace(
        angles,
        np.zeros(len(masks), np.int32),
        np.random.default_rng(0).normal(size=(len(masks), 9)),
    )

    def divide(score):
        split = Split.start(samples, poses)
        split.run(score, 0.012, threads=True)
        return split.nearest_node

    def dense(representative, samples, threads):
        return dense_distances(masks[representative], masks, np.ones(masks[0].shape))

    by_xor = LibrarySettings(weighting="xor")
    ours = Timed(lambda _: divide(Scorer(Spans.from_masks(masks), (80, 60), by_xor, _WINDOW)))
    name = "distances pixel by pixel, compiled"
    same = lambda a, b: "" if (a == b).mean() > 0.99 else "the results differ"  # noqa: E731
    return Case(ours, Timed(lambda _: divide(dense)), name, same, rounds=2)
