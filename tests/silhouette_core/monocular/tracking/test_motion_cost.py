"""What a step costs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.monocular.tracking.motion_cost import (
    PoseCandidates,
    ProcessNoise,
    transition_cost,
    yaw_rotations,
)

NOISE = ProcessNoise(np.array([0.1, 0.2, 0.1]), restart_cost=30.0)


def candidates(count, time_s, seed):
    rng = np.random.default_rng(seed)
    return PoseCandidates(
        rng.normal(0, 0.05, (count, 3)),
        Rotation.from_rotvec(rng.normal(0, 0.1, (count, 3))).as_matrix(),
        rng.normal(0, 0.2, (count, 3)),
        rng.random((count, 3)) < 0.3,
        time_s,
    )


def test_a_step_costs_what_the_normal_distribution_says():
    """(4), with the source's hidden parts of (5), both with the library's grain."""
    before, after = candidates(4, 0.0, 1), candidates(5, 1 / 30, 2)
    result = transition_cost(before, after, ProcessNoise(NOISE.sigma_rad, restart_cost=1e9))
    for a in range(4):
        for b in range(5):
            sigma = np.sqrt((NOISE.sigma_rad * np.where(before.occluded[a], 5, 1)) ** 2 + 0.10**2)
            joints = (((after.angles_rad[b] - before.angles_rad[a]) / sigma) ** 2).sum()
            turn = Rotation.from_matrix(
                before.root_rotation[a].T @ after.root_rotation[b]
            ).magnitude() ** 2 / (0.10**2 + 0.10**2)
            place = ((after.root_m[b] - before.root_m[a]) ** 2).sum() / (0.05**2 + 0.05**2)
            normaliser = np.log(sigma / np.hypot(NOISE.sigma_rad, 0.10)).sum()
            assert result[a, b] == pytest.approx(
                0.5 * (joints + turn + place) + normaliser, rel=1e-6
            )


def test_what_is_hidden_moves_cheaply_and_a_jump_has_a_price():
    still = PoseCandidates(
        np.zeros((1, 3)),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.zeros((1, 3), bool),
        0.0,
    )
    occluded = PoseCandidates(
        np.zeros((1, 3)),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([[True, False, False]]),
        0.0,
    )
    moved = PoseCandidates(
        np.zeros((1, 3)),
        np.eye(3)[None],
        np.array([[0.5, 0.0, 0.0]]),
        np.zeros((1, 3), bool),
        1 / 30,
    )
    assert (
        transition_cost(occluded, moved, NOISE)[0, 0]
        < 0.3 * transition_cost(still, moved, NOISE)[0, 0]
    )
    far = PoseCandidates(
        np.full((1, 3), 9.0),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.zeros((1, 3), bool),
        1 / 30,
    )
    assert transition_cost(still, far, NOISE)[0, 0] == NOISE.restart_cost


def test_headings_turn_about_the_vertical():
    quarter = yaw_rotations(np.array([np.pi / 2]))[0]
    np.testing.assert_allclose(quarter @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(quarter @ [0, 0, 1], [0, 0, 1], atol=1e-12)
