"""The filter against the dense equations."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silhouette_core.monocular.tree.evidence import UNMOVED, Evidence
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.window import look_at
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed


@pytest.fixture(scope="module")
def evidence():
    camera = camera_at((0, -4.0, 1.4))
    mask = films(performed("wave"), camera, [20])[0]
    return Evidence(
        [look_at(camera, mask, distance, STATURE_PX / STATURE_M) for distance in (4.0, 3.8)],
        CpuBackend(),
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


def filled(posterior, count):
    every = np.zeros(count)
    every[posterior.samples] = posterior.probability
    return every


@pytest.fixture(scope="module")
def alignments(library, evidence):
    """Of all nodes of every level: moved to where they fit best, and not moved."""
    result = []
    for level, reduction in zip(library.levels, (4, 2, 1), strict=True):
        case = level.spans, np.arange(len(level)), reduction
        result.append((evidence.distances(*case), evidence.distances(*case, UNMOVED)))
    return result


def literal_posterior(library, prior, alignments, settings):
    """Section 6 node by node, with the program's pruning: each sample's probability, the least
    distance of its leaf, with window and shift; NaN where the leaf did not survive; nodes scored.
    """
    homes = [leaves(library)]
    for level in library.levels[:0:-1]:
        homes.insert(0, level.parent[homes[0]])
    scored, survivors = [], np.ones(1, bool)
    for depth, (level, home) in enumerate(zip(library.levels, homes, strict=True)):
        moved, unmoved = alignments[depth]
        distance, scale = unmoved.distance, unmoved.scale
        parent = level.parent if depth else np.zeros(len(level), int)
        share = np.where(survivors[parent], np.bincount(home, prior, len(level)), np.nan)
        sigma = settings.sigma * settings.coarse ** (2 - depth)  # grows with every level above
        scored.append(np.isfinite(share).sum())
        order = np.argsort(-np.exp(-0.5 * (distance / sigma) ** 2) * share)  # NaN are last
        best = order[: settings.moved if scored[-1] > 2 * settings.moved else scored[-1]]
        rows = np.column_stack([distance, scale, np.zeros((len(level), 2))])
        rows[best] = np.column_stack([moved.distance, moved.scale, moved.shift_px])[best]
        likelihood = np.exp(-0.5 * (rows[:, 0] / sigma) ** 2)  # (10), (11)
        posterior = likelihood * share
        survivors = posterior >= settings.survivors * np.nanmax(posterior)
        survivors &= np.isin(np.arange(len(level)), np.argsort(-posterior)[: settings.most])
    home = homes[-1]
    probability = np.where(survivors[home], likelihood[home] * prior, 0.0)  # (12), (13)
    rows = np.where(survivors[home, None], rows[home], np.nan)
    return probability / probability.sum(), rows, scored  # (1)


@given(
    st.integers(0, 10**6),
    st.sampled_from([0.0, 1e-3, 0.05]),
    st.sampled_from([1, 7, 40, 10**9]),
    st.sampled_from([30, 10**9]),
)
@settings(max_examples=100, deadline=None)
def test_the_posterior_is_the_literal_one(
    library, tree, evidence, alignments, seed, survivors, most, moved
):
    """Whatever is pruned, and however few nodes are moved; impossible poses stay so."""
    rng = np.random.default_rng(seed)
    prior = rng.dirichlet(np.full(len(library), 0.3)) * (rng.random(len(library)) < 0.9)
    chosen = replace(tree.settings, survivors=survivors, most=most, moved=moved)
    result = TreeFilter(library, tree.transitions, tree.backend, chosen).update(prior, evidence)
    probability, rows, scored = literal_posterior(library, prior, alignments, chosen)
    np.testing.assert_array_equal(np.sort(result.samples), np.flatnonzero(np.isfinite(rows[:, 0])))
    np.testing.assert_allclose(filled(result, len(library)), probability, rtol=1e-6, atol=1e-15)
    own = np.column_stack([result.distance, result.scale, result.shift_px])
    np.testing.assert_allclose(own, rows[result.samples], rtol=1e-9)
    assert list(result.scored) == scored
    assert (np.diff(result.probability) <= 0).all()


def test_pruning_scores_less_and_keeps_what_counts(library, tree, evidence, alignments, prior):
    """Of the dense posterior: every sample's prior times the likelihood of its leaf, (10)-(13)."""
    result = tree.update(prior, evidence)
    every = replace(tree.settings, survivors=0.0, most=10**9, moved=10**9)
    expected, rows, _ = literal_posterior(library, prior, alignments, every)
    assert np.isfinite(rows).all()
    assert result.scored[0] == len(library.levels[0])
    assert result.scored[-1] < 0.6 * len(library.levels[-1])
    assert result.probability.sum() == pytest.approx(1.0)
    assert result.samples[0] == expected.argmax()
    assert np.abs(filled(result, len(library)) - expected).sum() < 0.05


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
