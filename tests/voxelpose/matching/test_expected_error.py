"""Errors to be expected: the evidence of a pose, and what it says."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.matching.matching_scenes import (
    fitting_model,
    photograph,
    stance,
    views,
)
from voxelpose.carving.carver import CarveRule
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.expected_error import (
    ERROR_WEIGHTS,
    NEAR_WEIGHTS,
    RIGHT_WEIGHTS,
    expected_errors,
    frame_evidence,
    half_turn_ratio,
    regressors,
)
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import HullObserver
from voxelpose.matching.pose_search import BodyGeometry

VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)


@pytest.fixture(scope="module")
def scene():
    """A body in a pose with one arm raised and bent, its joints, and how four cameras see it."""
    model = fitting_model()
    pose = stance(model, {"left_upper_arm.abduction": 60.0, "left_forearm.flexion": 70.0})
    observer = HullObserver(views(4), VOLUME, 0.04, CarveRule(least_agreeing=3))
    frame = observer.observe(photograph(observer.views, model, pose))
    return BodyGeometry.from_surface(Surface(model), 0.04), pose, frame


def joints(model, pose):
    rotation, origin = place(
        model, pose.root_m[None], pose.root_rotation[None], pose.angles_rad[None]
    )
    return landmarks(model, rotation, origin)[0]


def test_the_right_pose_has_nothing_against_it_and_a_wrong_arm_is_seen_at_that_arm(scene):
    body, pose, frame = scene
    right = frame_evidence(body, pose, joints(body.model, pose), frame, 0.0)
    assert right.camera_error.shape == (4,) and right.camera_error.max() < 0.02
    angles = pose.angles_rad.copy()
    angles[body.model.dof_names.index("left_forearm.flexion")] = 0.0
    other = replace(pose, angles_rad=angles)
    wrong = frame_evidence(body, other, joints(body.model, other), frame, 0.0)
    names = list(range(15))
    assert wrong.camera_error.mean() > 2 * right.camera_error.mean()
    # 11 is the left wrist, 12 to 14 the right arm.
    assert max(names, key=lambda k: wrong.joint_error[k]) == 11
    assert wrong.joint_error[11] > 10 * wrong.joint_error[14]


def test_a_body_turned_half_round_explains_less(scene):
    body, pose, frame = scene
    assert half_turn_ratio(body, pose, frame, MatchSettings()) > 1.5


def test_worse_evidence_is_never_said_to_be_better():
    """Every share that body and silhouettes differ by lowers the probabilities, a half turn that
    explains less raises them.
    """
    assert (RIGHT_WEIGHTS[[1, 4]] < 0).all() and RIGHT_WEIGHTS[3] > 0
    assert NEAR_WEIGHTS[17] < 0 < ERROR_WEIGHTS[17]
    good = expected_errors(np.full((1, 4), 0.06), np.full((1, 15), 0.02), np.zeros(1), 4.0)
    bad = expected_errors(np.full((1, 4), 0.35), np.full((1, 15), 0.2), np.full(1, 0.05), 1.1)
    assert good.right_probability[0] > 0.95 and bad.right_probability[0] < 0.5
    assert good.near_probability.min() > 0.7 > bad.near_probability.max()
    assert good.median_mm.max() < 40 < bad.median_mm.max()


def test_frames_without_evidence_say_nothing():
    nothing = expected_errors(
        np.full((1, 4), np.nan), np.full((1, 15), np.nan), np.full(1, np.nan), 3.0
    )
    assert np.isnan(nothing.right_probability).all() and np.isnan(nothing.median_mm).all()
    rows, frames = regressors(
        np.full((2, 4), 0.1), np.full((2, 15), 0.05), np.zeros(2), half_turn=2.0
    )
    assert rows.shape == (2, 15, 20) and frames.shape == (2, 5)
