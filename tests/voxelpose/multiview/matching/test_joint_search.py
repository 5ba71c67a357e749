"""The exact joint search and its sets of voxels as bits."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from voxelpose.multiview.matching.joint_search import best_together
from voxelpose.multiview.matching.kernels.bits import find_dominated


@st.composite
def groups(draw):
    """Up to four parts with up to six placements on up to two words of voxels, with costs that tie
    often; most placements take after a few sets that all parts like.
    """
    width = 64 * draw(st.integers(1, 2))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    density, alike = (
        draw(st.sampled_from([0.02, 0.1, 0.5])),
        draw(st.sampled_from([0.0, 0.8, 0.95])),
    )
    liked = rng.random((3, width)) < density
    bits, costs = [], []
    for _ in range(draw(st.integers(1, 4))):
        count = draw(st.integers(1, 6))
        sets = rng.random((count, width)) < density
        sets = np.where(rng.random(sets.shape) < alike, liked[rng.integers(0, 3, count)], sets)
        bits.append(np.packbits(sets, axis=1, bitorder="little").view(np.uint64))
        costs.append(rng.integers(0, 8, count) * draw(st.sampled_from([0.0, 0.7, 2.0])))
    return bits, costs


def score_of(bits, costs, choice):
    union = np.bitwise_or.reduce([part[k] for part, k in zip(bits, choice, strict=True)])
    return int(np.bitwise_count(union).sum()) - sum(
        cost[k] for cost, k in zip(costs, choice, strict=True)
    )


@given(groups())
@settings(max_examples=300, deadline=None)
def test_search_is_as_good_as_trying_everything(group):
    bits, costs = group
    choice, score, exact = best_together(bits, costs)
    assert exact
    choices = product(*(range(len(part)) for part in bits))
    assert score == pytest.approx(max(score_of(bits, costs, one) for one in choices))
    assert score_of(bits, costs, choice) == pytest.approx(score)


@pytest.mark.parametrize("bits", [[], [np.zeros((0, 1), np.uint64)]])
def test_nothing_to_choose_from_is_refused(bits):
    with pytest.raises(ValueError, match="at least one placement"):
        best_together(bits, [np.zeros(len(part)) for part in bits])


def test_a_placement_falls_only_to_one_that_is_better_whatever_is_taken():
    rng = np.random.default_rng(4)
    rows = rng.integers(0, 2**12, (40, 1)).astype(np.uint64)
    gain = rng.integers(-6, 6, 40).astype(float)
    dominated = np.zeros(40, np.bool_)
    find_dominated(rows, gain, dominated)
    assert 5 < dominated.sum() < 40
    for taken in rng.integers(0, 2**12, 200).astype(np.uint64):
        score = gain + np.bitwise_count(rows[:, 0] & ~taken)
        assert score[~dominated].max() == score.max()


def test_a_search_that_stops_at_its_bound_says_so_and_keeps_a_good_choice():
    """Four parts with overlapping sets, none of which can be discarded beforehand."""
    rng = np.random.default_rng(5)
    density = rng.uniform(0.2, 0.3, (4, 150, 1))
    sets = rng.random((4, 150, 512)) < density
    bits = [np.packbits(part, axis=1, bitorder="little").view(np.uint64) for part in sets]
    costs = [np.zeros(150)] * 4
    stopped, whole = best_together(bits, costs, most_bytes=20_000), best_together(bits, costs)
    assert not stopped.exact and whole.exact
    assert stopped.score == pytest.approx(score_of(bits, costs, stopped.choice))
    assert 0.9 * whole.score < stopped.score <= whole.score
