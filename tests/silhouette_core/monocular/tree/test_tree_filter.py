"""The filter against the dense equations."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.tree.evidence import Evidence
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.tuning import MOTION_MODEL, FilterSettings
from silhouette_core.monocular.window import look_at
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed

EVERY_NODE = FilterSettings(survivors=0.0, most=10**9, moved=10**9)


@pytest.fixture(scope="module")
def evidence():
    camera = camera_at((0, -4.0, 1.4))
    mask = films(performed("wave"), camera, [20])[0]
    return Evidence(
        [look_at(camera, mask, distance, STATURE_PX / STATURE_M) for distance in (4.0, 3.8)],
        "balanced",
    )


@pytest.fixture(scope="module")
def prior(library):
    return np.random.default_rng(3).dirichlet(np.full(len(library), 0.3))


def leaves(library):
    """The leaf of every sample."""
    of = np.empty(len(library), np.int64)
    of[library.leaf_samples] = np.repeat(
        np.arange(len(library.levels[-1])), np.diff(library.leaf_offsets)
    )
    return of


def dense_posterior(library, prior, evidence, sigma):
    """Every sample's prior times the likelihood of its leaf's representative, (10)-(13)."""
    distance = evidence.distances(
        library.levels[-1].spans, np.arange(len(library.levels[-1])), 1
    ).distance
    likelihood = np.exp(-(distance[leaves(library)] ** 2) / (2 * sigma**2))
    return likelihood * prior / (likelihood * prior).sum(), distance


def filled(posterior, count):
    every = np.zeros(count)
    every[posterior.samples] = posterior.probability
    return every


def test_without_pruning_the_posterior_is_the_dense_one(library, tree, evidence, prior):
    result = TreeFilter(library, tree.transitions, EVERY_NODE).update(prior, evidence)
    expected, distance = dense_posterior(library, prior, evidence, EVERY_NODE.sigma)
    assert result.scored == tuple(len(level) for level in library.levels)
    assert sorted(result.samples) == list(range(len(library)))
    np.testing.assert_allclose(filled(result, len(library)), expected, rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(result.distance, distance[leaves(library)][result.samples])
    assert (np.diff(result.probability) <= 0).all()


def test_pruning_scores_less_and_keeps_what_counts(library, tree, evidence, prior):
    result = tree.update(prior, evidence)
    expected, _ = dense_posterior(library, prior, evidence, tree.settings.sigma)
    assert result.scored[0] == len(library.levels[0])
    assert result.scored[-1] < 0.6 * len(library.levels[-1])
    assert result.probability.sum() == pytest.approx(1.0)
    assert result.samples[0] == expected.argmax()
    assert np.abs(filled(result, len(library)) - expected).sum() < 0.05


def test_moving_only_likely_nodes_changes_nothing_that_counts(library, tree, evidence, prior):
    few = TreeFilter(library, tree.transitions, replace(tree.settings, moved=30))
    assert len(library.levels[0]) > 2 * few.settings.moved
    result, every = (one.update(prior, evidence) for one in (few, tree))
    assert result.samples[0] == every.samples[0]
    shares = [filled(one, len(library)) for one in (result, every)]
    assert np.abs(shares[0] - shares[1]).sum() < 0.1
    moved, unmoved = (
        evidence.distances(library.levels[0].spans, np.arange(9), 4, moved).distance
        for moved in (True, False)
    )
    assert (moved <= unmoved + 1e-9).all() and (moved < unmoved).any()


@pytest.mark.parametrize("most", [1, 7])
def test_not_more_nodes_are_kept_than_allowed(library, tree, evidence, prior, most):
    result = TreeFilter(library, tree.transitions, replace(EVERY_NODE, most=most)).update(
        prior, evidence
    )
    assert len(np.unique(leaves(library)[result.samples])) == most


def test_a_pose_that_is_impossible_stays_so(library, tree, evidence, prior):
    prior = np.where(np.arange(len(library)) % 2, prior, 0.0)
    result = tree.update(prior, evidence)
    assert (result.probability[result.samples % 2 == 0] == 0).all()


@pytest.mark.parametrize("steps", [1, 3])
def test_the_prior_is_the_dense_sum(library, tree, evidence, prior, steps):
    posterior = tree.update(prior, evidence)
    belief = filled(posterior, len(library))
    for _ in range(steps):
        belief = sum(
            weight * tree.transitions[[n]].toarray()[0] for n, weight in enumerate(belief) if weight
        )
    floor = tree.settings.floor
    expected = (1 - floor) * belief / belief.sum() + floor / len(library)
    np.testing.assert_allclose(tree.predict(posterior, steps), expected, rtol=1e-5, atol=1e-12)


def test_hidden_parts_go_farther_in_dm2_and_only_they_do(library):
    dm1, dm2 = (
        transitions(library, aware, 4 * MOTION_MODEL.sigma_scale) for aware in (False, True)
    )
    moving = np.unique(library.model.tree.dof_part[library.base_angles.std(0) > np.radians(3)])
    some, none = library.occluded[:, moving].any(1), ~library.occluded.any(1)
    assert some.any() and none.any()
    differs = np.array([abs(dm1[[n]] - dm2[[n]]).max() > 1e-6 for n in range(len(library))])
    assert not differs[none].any()
    assert differs[some].mean() > 0.98
    # (5): the source stays less likely where it hides something.
    assert dm2.diagonal()[some].mean() < dm1.diagonal()[some].mean()


def test_a_node_survives_by_likelihood_and_prior(library, evidence, prior):
    """Eq. (10) and (11), with a sigma that grows with every level above the last."""
    settings = FilterSettings(survivors=0.05, most=10**9, moved=10**9)
    tree = TreeFilter(library, None, settings)
    for depth, level in enumerate(library.levels):
        nodes = np.arange(len(level))
        share = np.random.default_rng(depth).dirichlet(np.full(len(level), 0.2))
        alignment, log_likelihood, kept = tree.score_level(depth, nodes, share, evidence)
        sigma = settings.sigma * settings.coarse ** (2 - depth)
        np.testing.assert_allclose(log_likelihood, -0.5 * (alignment.distance / sigma) ** 2)
        posterior = np.exp(log_likelihood) * share
        np.testing.assert_array_equal(kept, np.flatnonzero(posterior >= 0.05 * posterior.max()))
        likely = np.exp(log_likelihood)
        assert set(kept) != set(np.flatnonzero(likely >= 0.05 * likely.max()))
