"""Expected errors of angles beside those of joints that were moved at random."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.angle_errors import expected_angle_errors
from tests.clips import waving

JOINTS = {"knee_flexion": ("hip", "knee", "ankle"), "elbow_flexion": ("shoulder", "elbow", "wrist")}


def between_deg(points):
    """Angles (N,) between two segments of points (N, 4, 3)."""
    u, v = points[:, 1] - points[:, 0], points[:, 3] - points[:, 2]
    cosine = (u * v).sum(1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
    return np.degrees(np.arccos(cosine))


@pytest.fixture
def stated():
    """A motion, and errors that differ from joint to joint."""
    motion = waving(6)
    errors_mm = np.tile(np.linspace(4, 12, 15), (6, 1))
    return replace(motion, quality={"joint_error_mm": errors_mm}), errors_mm[0]


@pytest.mark.parametrize("name", ["left_knee_flexion", "right_elbow_flexion", "left_hip_adduction"])
def test_half_of_the_angles_are_within_it(stated, name):
    motion, errors_mm = stated
    side, _, kind = name.partition("_")
    if kind == "hip_adduction":
        ends = ["left_hip", "right_hip", "left_hip", "left_knee"]
    else:
        start, middle, end = (f"{side}_{joint}" for joint in JOINTS[kind])
        ends = [start, middle, middle, end]
    rng = np.random.default_rng(2)
    numbers = [LANDMARK_NAMES.index(joint) for joint in ends]
    sigma_m = errors_mm[numbers] / 1000 / chi.median(3)
    true = motion.landmarks()[3, numbers]
    moved = {joint: rng.normal(size=(20_000, 3)) for joint in set(ends)}
    noise = np.stack([moved[joint] for joint in ends], axis=1) * sigma_m[:, None]
    off = np.abs(between_deg(true + noise) - between_deg(true[None]))
    within = expected_angle_errors(motion)[name][3]
    assert np.mean(off < within) == pytest.approx(0.5, abs=0.02)


def test_nothing_is_said_where_joints_have_no_errors(stated):
    motion, _ = stated
    assert expected_angle_errors(replace(motion, quality={})) == {}
    names = set(expected_angle_errors(motion))
    assert "left_ankle_dorsiflexion" in names
    assert not [name for name in names if "hip_flexion" in name or "shoulder" in name]
