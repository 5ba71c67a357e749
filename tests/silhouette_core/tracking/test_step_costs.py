"""What a step costs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.monocular.tree.rendering import yaw_rotations
from silhouette_core.motion.dynamics import ROOT_STEP_M, ROOT_STEP_RAD
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.tracking.step_costs import transition_cost

SIGMA_RAD, SPACING_RAD = np.array([0.1, 0.2, 0.1]), np.radians(3)


def candidates(count, seed):
    rng = np.random.default_rng(seed)
    return PoseArrays(
        rng.normal(0, 0.05, (count, 3)),
        Rotation.from_rotvec(rng.normal(0, 0.1, (count, 3))).as_matrix(),
        rng.normal(0, 0.2, (count, 3)),
    )


def test_a_step_costs_what_the_normal_distribution_says():
    """(4), with the source's hidden parts of (5), both with the grain of refined poses."""
    before, after = candidates(4, 1), candidates(5, 2)
    occluded = np.random.default_rng(3).random((4, 3)) < 0.3
    widened = np.where(occluded, 5.0, 1.0)
    result = transition_cost(before, after, widened, SIGMA_RAD, 1.0)
    for a in range(4):
        for b in range(5):
            sigma = np.hypot(SIGMA_RAD * np.where(occluded[a], 5, 1), SPACING_RAD)
            joints = (((after.angles_rad[b] - before.angles_rad[a]) / sigma) ** 2).sum()
            turn = Rotation.from_matrix(before.root_rotation[a].T @ after.root_rotation[b])
            turned = turn.magnitude() ** 2 / (ROOT_STEP_RAD**2 + SPACING_RAD**2)
            place = ((after.root_m[b] - before.root_m[a]) ** 2).sum() / (ROOT_STEP_M**2 + 0.05**2)
            normaliser = np.log(sigma / np.hypot(SIGMA_RAD, SPACING_RAD)).sum()
            expected = 0.5 * (joints + turned + place) + normaliser
            assert result[a, b] == pytest.approx(expected, rel=1e-6)


def test_what_is_hidden_moves_cheaply():
    def cost(occluded, angle_rad):
        still, moved = (
            PoseArrays(np.zeros((1, 3)), np.eye(3)[None], np.array([[angle, 0.0, 0.0]]))
            for angle in (0.0, angle_rad)
        )
        widened = np.array([[5.0 if occluded else 1.0, 1.0, 1.0]])
        return transition_cost(still, moved, widened, SIGMA_RAD, 1.0)

    assert cost(True, 0.5) < 0.3 * cost(False, 0.5)


def test_headings_turn_about_the_vertical():
    quarter = yaw_rotations(np.array([np.pi / 2]))[0]
    np.testing.assert_allclose(quarter @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(quarter @ [0, 0, 1], [0, 0, 1], atol=1e-12)
