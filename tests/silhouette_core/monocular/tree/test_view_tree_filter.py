"""The filter over trees of views, against the dense equations."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.making.base_poses import base_poses
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tree import view_tree_filter
from silhouette_core.monocular.tree.evidence import Evidence
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.transitions import NeighbourWeights, transitions
from silhouette_core.monocular.tree.tree_filter import SIGMA_SCALE, FilterSettings, TreeFilter
from silhouette_core.monocular.tree.view_tree_filter import SparsePrior, ViewTreeFilter, tree_filter
from silhouette_core.monocular.window import look_at
from tests.silhouette_core.monocular.conftest import SETTINGS
from tests.silhouette_core.monocular.filming import (
    MOVEMENTS,
    STATURE_M,
    body,
    camera_at,
    films,
    performed,
)
from tests.silhouette_core.monocular.test_ablation import expected_error_m

CAMERA = camera_at((0, -4.0, 1.4))
EVERY_NODE = FilterSettings(survivors=0.0, most=10**9, moved=10**9)


@pytest.fixture(scope="module")
def by_view():
    """About 1,900 samples: 80 poses from 24 sides."""
    settings = replace(SETTINGS, tree="views")
    bases = base_poses({name: performed(name) for name in MOVEMENTS}, settings)
    return build_library(bases, body(), settings)


@pytest.fixture(scope="module")
def weights(by_view):
    return NeighbourWeights(by_view, True, SIGMA_SCALE)


@pytest.fixture
def evidence(by_view):
    mask = films(performed("wave"), CAMERA, [20])[0]
    windows = [look_at(CAMERA, mask, distance, STATURE_PX / STATURE_M) for distance in (4.0, 3.8)]
    return Evidence(windows, "balanced", bounds_px=by_view.bounds_px, drawn_small=True)


def dense(prior, library):
    """A sparse prior as probabilities of all samples."""
    result = prior.of_view[library.sample_view].copy()
    result[prior.samples] += prior.probability
    return result


@pytest.fixture(scope="module")
def prior(by_view):
    rng = np.random.default_rng(3)
    samples = np.sort(rng.permutation(len(by_view))[:90])
    of_view = rng.uniform(0.5, 1.5, len(by_view.views))
    of_view *= 0.3 / (of_view.sum() * len(by_view.base_angles))
    return SparsePrior(samples, 0.7 * rng.dirichlet(np.ones(90)), of_view)


@pytest.mark.parametrize("as_array", [False, True])
def test_if_all_nodes_are_followed_the_posterior_is_the_dense_one(
    by_view, weights, evidence, prior, as_array, monkeypatch
):
    monkeypatch.setattr(view_tree_filter, "FOLLOWED", (10**9,) * 3)
    given = dense(prior, by_view) if as_array else prior
    result = ViewTreeFilter(by_view, weights, EVERY_NODE).update(given, evidence)
    leaves = by_view.levels[2]
    distance = evidence.distances(leaves.spans, np.arange(len(leaves)), 2).distance
    likelihood = np.exp(-(distance**2) / (2 * EVERY_NODE.sigma**2))
    expected = np.empty(len(by_view))
    expected[by_view.leaf_samples] = likelihood
    expected *= dense(prior, by_view)
    found = np.zeros(len(by_view))
    found[result.samples] = result.probability
    assert result.scored == tuple(len(level) for level in by_view.levels)
    np.testing.assert_allclose(found, expected / expected.sum(), rtol=1e-6, atol=1e-15)
    assert (np.diff(result.probability) <= 0).all()


@pytest.mark.parametrize("steps", [1, 3])
def test_prediction_is_that_of_the_matrix(by_view, weights, evidence, prior, steps):
    tree = ViewTreeFilter(by_view, weights)
    posterior = tree.update(prior, evidence)
    matrix = transitions(by_view, True, SIGMA_SCALE)
    expected = TreeFilter(by_view, matrix).predict(posterior, steps)
    found = dense(tree.predict(posterior, steps), by_view)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-9)


def test_priors_are_mixed_and_weighed_as_arrays_are(by_view, weights, prior):
    tree, array = ViewTreeFilter(by_view, weights), dense(prior, by_view)
    plain = TreeFilter(by_view, transitions(by_view, True))
    of_view = np.random.default_rng(0).uniform(0.1, 1, len(by_view.views))
    for ours, theirs in (
        (tree.spread(prior, 0.4), plain.spread(array, 0.4)),
        (tree.weigh_views(prior, of_view), plain.weigh_views(array, of_view)),
    ):
        np.testing.assert_allclose(dense(ours, by_view), theirs, rtol=1e-9)


def test_views_without_prior_are_not_scored(by_view, weights, evidence, prior):
    one_side = np.where(np.arange(len(by_view.views)) < 6, 1.0, 1e-9)
    nobody = SparsePrior(prior.samples[:0], prior.probability[:0], prior.of_view)
    tree = ViewTreeFilter(by_view, weights)
    result = tree.update(tree.weigh_views(nobody, one_side), evidence)
    of_first = by_view.sample_view[by_view.levels[0].representative]
    assert result.scored[0] == (of_first < 6).sum()
    assert by_view.sample_view[result.samples].max() < 6


def follow(tree, masks):
    filter_ = ForwardFilter(tree, CAMERA, facing=False)
    return [filter_.step(k, k / 30, Person(mask, False)) for k, mask in enumerate(masks)]


def test_a_narrow_search_finds_the_best_hundred_of_all(by_view, monkeypatch):
    """Frame by frame under the same prior, with few of the samples."""
    masks = films(performed("stroll"), CAMERA, range(0, 24, 2))
    weights = NeighbourWeights(by_view, True, SIGMA_SCALE)
    tree, whole = (ViewTreeFilter(by_view, weights, EVERY_NODE) for _ in range(2))
    update, found, scored = tree.update, [], []

    def compared(prior, evidence):
        with monkeypatch.context() as patch:
            patch.setattr(view_tree_filter, "FOLLOWED", (10**9,) * 3)
            best = whole.update(prior, evidence).samples[:100]
        posterior = update(prior, evidence)
        found.append(np.isin(best, posterior.samples).mean())
        scored.append(posterior.scored[-1] / len(by_view))
        return posterior

    monkeypatch.setattr(view_tree_filter, "FOLLOWED", (250, 300, 300))
    monkeypatch.setattr(tree, "update", compared)
    follow(tree, masks)
    assert np.mean(found) > 0.97
    assert np.mean(scored) < 0.5


def test_tracks_as_well_as_the_filter_of_one_tree(by_view, library):
    motion, rows = performed("wave"), range(0, 32, 2)
    masks, truth = films(motion, CAMERA, rows), motion.landmarks()[list(rows)]
    error, distance = [], []
    for poses in (by_view, library):
        tree = tree_filter(poses, True, 1 / 15)
        filter_ = ForwardFilter(tree, CAMERA, interval_s=1 / 15)
        frames = [filter_.step(k, k / 15, Person(mask, False)) for k, mask in enumerate(masks)]
        pairs = list(zip(frames, truth, strict=True))[4:]
        error.append(np.mean([expected_error_m(tree, *pair) for pair in pairs]))
        distance.append(np.mean([frame.posterior.distance[0] for frame, _ in pairs]))
    assert error[0] < 1.1 * error[1]
    assert distance[0] < distance[1] + 0.01
