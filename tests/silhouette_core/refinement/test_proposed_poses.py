"""Poses that are proposed: their cost, and the same poses of a larger body."""

import numpy as np
import pytest

from silhouette_core.refinement.proposed_poses import ProposedPoses
from tests.silhouette_core.monocular.filming import prior_at

JOINTS = np.random.default_rng(2).normal(0, 0.4, (2, 15, 3))


def poses(sigma_m: float = 0.05) -> ProposedPoses:
    """Two poses, the second one likelier."""
    return ProposedPoses(np.array([0.2, 0.8]), [prior_at(one, sigma_m) for one in JOINTS])


def test_the_likeliest_come_first():
    proposed = poses()
    np.testing.assert_allclose(proposed.likeliest, JOINTS[1])
    assert proposed.probable(1) == [proposed.priors[1]]
    assert proposed.nearest(JOINTS[0] + 1.0) is proposed.priors[0]


def test_a_pose_costs_the_more_the_less_probable_it_is():
    likely, unlikely, between = poses().cost(np.stack([JOINTS[1], JOINTS[0], JOINTS.mean(axis=0)]))
    assert unlikely - likely == pytest.approx(np.log(4), abs=0.1) and between > unlikely + 1


def test_a_larger_body_in_its_pose_costs_as_much():
    moved = JOINTS + np.random.default_rng(3).normal(0, 0.05, JOINTS.shape)
    elsewhere = np.array([1.0, 2.0, 3.0])
    larger = poses().at(elsewhere, 1.1)
    np.testing.assert_allclose(larger.cost(1.1 * moved + 5.0), poses().cost(moved))
    np.testing.assert_allclose(larger.likeliest[0], elsewhere)
