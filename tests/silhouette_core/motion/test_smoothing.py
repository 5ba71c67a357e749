"""Smoothing of motion over time, and steps between poses."""

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.motion.smoothing import smooth, smooth_quaternions, smooth_runs


def test_smoothing_keeps_what_stands_still_and_what_moves_evenly():
    constant = np.full((60, 3), [0.3, -1.0, 2.0])
    np.testing.assert_allclose(smooth(constant, 30.0), constant, atol=1e-12)
    ramp = np.linspace(0, 1, 60)[:, None]
    np.testing.assert_allclose(smooth(ramp, 30.0)[8:-8], ramp[8:-8], atol=1e-3)


def test_smoothing_has_no_lag_and_removes_jitter():
    t = np.arange(200) / 50.0
    slow = np.sin(2 * np.pi * 1.0 * t)[:, None]
    smoothed = smooth(slow, 50.0)
    shifts = np.arange(-5, 6)
    match = [float((smoothed[20:-20] * np.roll(slow, s, 0)[20:-20]).sum()) for s in shifts]
    assert shifts[int(np.argmax(match))] == 0
    np.testing.assert_allclose(smoothed[20:-20], slow[20:-20], atol=0.01)
    jitter = np.random.default_rng(0).normal(size=(200, 1))
    third = lambda values: np.abs(np.diff(values, 3, axis=0)).mean()  # noqa: E731
    assert third(smooth(jitter, 50.0)) < 0.2 * third(jitter)
    # Time reversed gives the same, reversed: neither direction is preferred.
    np.testing.assert_allclose(
        smooth(jitter[::-1], 50.0)[20:-20], smooth(jitter, 50.0)[::-1][20:-20], atol=1e-3
    )


def test_short_and_slow_motions_are_left_as_they_are():
    values = np.random.default_rng(0).normal(size=(12, 2))
    assert smooth(values, 30.0) is values
    values = np.random.default_rng(0).normal(size=(100, 2))
    assert smooth(values, 15.0) is values


def test_smoothed_rotations_stay_rotations_whatever_their_signs():
    steps = Rotation.from_rotvec(np.linspace([0, 0, 0], [0, 0, 4.0], 80))
    quaternions = steps.as_quat(scalar_first=True) * np.random.default_rng(1).choice(
        [-1, 1], (80, 1)
    )
    smoothed = smooth_quaternions(quaternions, 30.0)
    np.testing.assert_allclose(np.linalg.norm(smoothed, axis=1), 1)
    apart = (Rotation.from_quat(smoothed, scalar_first=True) * steps.inv()).magnitude()
    assert apart[8:-8].max() < 0.01


def test_frames_that_are_missing_end_a_run():
    """Before and after the gap the body stands still, elsewhere."""
    frames = np.r_[np.arange(20), np.arange(60, 80)]
    places = np.repeat([[0.0, 0, 1], [2.0, 1, 1]], 20, axis=0)
    turns = Rotation.from_rotvec(np.repeat([[0, 0, 0.0], [0, 0, 2.0]], 20, axis=0))
    given = places, turns.as_quat(scalar_first=True), places[:, :2]
    smoothed = [values.copy() for values in given]
    smooth_runs(*smoothed, frames, 30.0)
    for values, expected in zip(smoothed, given, strict=True):
        np.testing.assert_allclose(values, expected, atol=1e-9)


def test_steps_between_poses_lead_there_and_back():
    rng = np.random.default_rng(2)
    poses = [
        Pose(
            rng.normal(size=3),
            Rotation.random(random_state=k).as_matrix(),
            RELAXED_RAD + rng.normal(size=len(RELAXED_RAD)),
        )
        for k in (0, 1)
    ]
    there = poses[0].moved(poses[1].minus(poses[0]))
    np.testing.assert_allclose(there.root_rotation, poses[1].root_rotation, atol=1e-12)
    np.testing.assert_allclose(there.minus(poses[1]), 0, atol=1e-12)
