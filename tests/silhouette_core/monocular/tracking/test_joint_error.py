"""Errors that are to be expected of one camera's poses."""

import numpy as np
import pytest

from silhouette_core.monocular.tracking.joint_error import hypothesis_spread, joint_errors

RNG = np.random.default_rng(3)
JOINTS = RNG.normal(0, 0.4, (15, 3))


def test_hypotheses_that_agree_have_no_spread_wherever_they_are():
    """A common shift is no difference between poses."""
    alike = JOINTS + RNG.normal(0, 1.0, (4, 1, 3))
    assert hypothesis_spread(np.array([0.1, 0.5, 0.3, 0.1]), alike) == pytest.approx(np.zeros(15))


def test_the_spread_is_the_mean_distance_from_the_likeliest():
    """A left wrist 20 cm away with 0.3, and one 50 cm away with 0.1."""
    hypotheses = np.stack([JOINTS] * 3)
    hypotheses[0, 4, 1] += 0.2
    hypotheses[2, 4, 0] -= 0.5
    spread = hypothesis_spread(np.array([0.3, 0.6, 0.1]), hypotheses)
    assert spread[4] == pytest.approx(0.3 * 0.2 + 0.1 * 0.5)
    assert np.delete(spread, 4) == pytest.approx(np.zeros(14))


def test_more_spread_less_agreement_and_occlusion_mean_larger_errors():
    spread, seen = np.full((1, 15), 0.03), np.zeros((1, 15), bool)
    usual = joint_errors(spread, np.array([0.9]), seen)
    assert 20 < usual.pose_mm[0] < 90 and (usual.joint_mm > 30).all()
    assert ((usual.near_probability > 0.02) & (usual.near_probability < 0.5)).all()
    one = spread.copy()
    one[0, 4] = 0.2
    worse = ((one, 0.9, seen), (spread, 0.7, seen), (spread, 0.9, ~seen))
    for apart, agreement, occluded in worse:
        found = joint_errors(apart, np.array([agreement]), occluded)
        assert found.joint_mm[0, 4] > usual.joint_mm[0, 4] * 1.05
        assert found.near_probability[0, 4] < usual.near_probability[0, 4]
        assert found.pose_mm[0] > usual.pose_mm[0]
    exact = joint_errors(np.zeros((2, 15)), np.ones(2), np.zeros((2, 15), bool))
    assert (exact.joint_mm > 0).all() and exact.pose_mm.shape == (2,)


def test_half_of_the_errors_are_said_to_be_above_the_median():
    """The two numbers of a joint come from one distribution."""
    spread = np.geomspace(0.001, 0.5, 200)[:, None] * np.ones(15)
    found = joint_errors(spread, np.full(200, 0.9), np.zeros((200, 15), bool))
    assert ((found.joint_mm < 30) == (found.near_probability > 0.5)).all()
