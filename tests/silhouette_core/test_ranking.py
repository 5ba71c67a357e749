"""What candidates are chosen by does not depend on the order of sums."""

import math

import numpy as np
import pytest

from silhouette_core.image.spans import Spans
from silhouette_core.ranking import rounded, summable
from silhouette_core.scoring.backend import Target
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import mask_errors
from tests.silhouette_core.scoring.backward_backend import BackwardBackend
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    other_body,
    photograph,
    stance,
    views,
)

BACKENDS = CpuBackend(), BackwardBackend()


def weights_of(rng, shape):
    return rng.random(shape) * 10.0 ** rng.integers(-6, 6)


@pytest.mark.parametrize("seed", range(4))
def test_sums_of_summable_weights_are_exact_in_any_order(seed):
    rng = np.random.default_rng(seed)
    weights = weights_of(rng, 5000) * rng.choice([-1, 1], 5000)
    exact = summable(weights)
    assert sum(exact.tolist()) == sum(sorted(exact.tolist())) == math.fsum(exact)
    assert sum(weights.tolist()) != sum(sorted(weights.tolist()))
    np.testing.assert_allclose(exact, weights, rtol=0, atol=1e-9 * np.abs(weights).max())


def test_no_weight_is_summable():
    assert not summable(np.zeros((2, 3))).any() and summable(np.zeros(0)).shape == (0,)


def test_a_difference_without_meaning_is_a_tie_and_the_first_wins():
    assert rounded([0.3, 0.1 + 0.2, 0.1]).argmax() == 0
    assert rounded([0.30001, 0.3]).argmin() == 1
    assert np.isneginf(rounded([-np.inf, 0])[0])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("windows", "shifts"), [(1, 1), (2, 9)])
def test_span_distances_are_the_same_backwards(seed, windows, shifts):
    rng = np.random.default_rng(seed)
    shape = 40, 60
    masks = [rng.random(shape) > 0.5 for _ in range(windows + 30)]
    weights = [weights_of(rng, shape).astype((float, np.float32)[k % 2]) for k in range(windows)]
    moves = rng.integers(-3, 4, (shifts, 2)) if shifts > 1 else np.zeros((1, 2), np.int64)
    target = Target(tuple(masks[:windows]), tuple(weights), moves, 0.7)
    spans = Spans.from_masks(masks[windows:])
    one, other = (own.span_distances(target, spans, np.arange(30)) for own in BACKENDS)
    np.testing.assert_array_equal(one, other)


def test_drawn_weights_are_the_same_backwards():
    rng = np.random.default_rng(3)
    meshes = rng.normal(size=(20, 30, 3)) * (0.5, 0.5, 0.1) + (0, 0, 1.2)
    mesh = meshes, np.arange(30).reshape(10, 3), np.array([[40.0, 0, 31], [0, 40, 23], [0, 0, 1]])
    weights = weights_of(rng, (48, 64))
    plain, exact = (
        [own.drawn_weights(one, *mesh) for own in BACKENDS] for one in (weights, summable(weights))
    )
    assert (plain[0] != plain[1]).any()
    np.testing.assert_array_equal(*exact)


def test_errors_of_poses_are_the_same_backwards():
    model, seen_by = fitting_model(), views(5, (80, 80))
    poses = [stance(model, place_m=(x, 0.0)) for x in np.linspace(0, 0.3, 20)]
    masks = photograph(seen_by, other_body(), stance(other_body()))
    one, other = (mask_errors(model, poses, seen_by, masks, own) for own in BACKENDS)
    np.testing.assert_array_equal(one, other)
