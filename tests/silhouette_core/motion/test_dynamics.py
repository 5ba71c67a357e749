"""Where a body is expected in the next frame, and between two frames."""

import numpy as np
import pytest

from silhouette_core.body.joints import HUMAN
from silhouette_core.motion.dynamics import FPS, MOMENTUM, RELAXED_RAD, elapsed_steps, predict
from silhouette_core.motion.pose import Pose

FLEXION = HUMAN.dof_names.index("left_forearm.flexion")


def at(x_m: float, yaw: float = 0.0, flexion: float = 0.5) -> Pose:
    angles = RELAXED_RAD.copy()
    angles[FLEXION] = flexion
    step = np.zeros(6 + len(angles))
    step[5] = yaw
    return Pose(np.array([x_m, 0.0, 1.0]), np.eye(3), angles).moved(step)


def test_a_body_goes_on_as_it_went_if_a_little_slower():
    expected = predict(at(0.3, 0.2, 0.7), at(0.2, 0.1, 0.5))
    step = expected.minus(at(0.3, 0.2, 0.7))
    assert 0.5 < MOMENTUM < 1
    assert step[[0, 5, 6 + FLEXION]] == pytest.approx(MOMENTUM * np.array([0.1, 0.1, 0.2]))


def test_a_body_whose_past_is_unknown_is_expected_to_stay():
    pose = at(0.3)
    assert predict(pose, None) is pose


def test_no_joint_is_expected_beyond_its_limit():
    low, high = HUMAN.dof_limits_rad[FLEXION]
    expected = predict(at(0.0, flexion=high - 0.01), at(0.0, flexion=high - 0.3))
    assert low <= expected.angles_rad[FLEXION] <= high


def test_steps_are_counted_at_the_usual_frame_rate():
    assert elapsed_steps(1.0, 1.0 + 3 / FPS) == pytest.approx(3)
    assert elapsed_steps(1.0 + 3 / FPS, 1.0) == pytest.approx(3)
    assert elapsed_steps(1.0, 1.0) == 0.5
