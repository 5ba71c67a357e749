"""Smoothing of motion over time, and steps between poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.motion.smoothing import LowPass, smooth, smooth_quaternions, smooth_runs


def test_smoothing_keeps_what_stands_still_and_what_moves_evenly():
    constant = np.full((60, 3), [0.3, -1.0, 2.0])
    np.testing.assert_allclose(smooth(constant, 30.0), constant, atol=1e-12)
    ramp = np.linspace(0, 1, 60)[:, None]
    np.testing.assert_allclose(smooth(ramp, 30.0)[8:-8], ramp[8:-8], atol=1e-3)


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


@pytest.mark.parametrize(
    "low_pass",
    [
        LowPass(),
        LowPass(order=4, cutoff_hz=5.0),
        LowPass("savgol", 5.0),
        LowPass("savgol", 7.0, 2),
        LowPass("gaussian", 6.0),
    ],
)
def test_every_filter_leaves_half_at_its_cutoff_and_nothing_lags(low_pass):
    fps = 200.0
    t = np.arange(1200) / fps
    turns = 2 * np.pi * low_pass.cutoff_hz * t
    middle = slice(400, 800)
    at, below, above = (
        smooth(np.sin(factor * turns)[:, None], fps, low_pass)[middle, 0]
        for factor in (1.0, 0.15, 3.0)
    )
    wave = np.sin(turns)[middle]
    assert at @ wave / (wave @ wave) == pytest.approx(0.5, abs=0.04)
    np.testing.assert_allclose(at, at @ wave / (wave @ wave) * wave, atol=0.02)  # no lag
    assert np.abs(below - np.sin(0.15 * turns)[middle]).max() < 0.05
    assert np.abs(above).max() < 0.26


@pytest.mark.parametrize("kind", ["butterworth", "savgol", "gaussian"])
def test_every_filter_keeps_an_even_motion_to_its_ends(kind):
    ramp = np.linspace(0, 1, 60)[:, None]
    np.testing.assert_allclose(smooth(ramp, 60.0, LowPass(kind)), ramp, atol=2e-3)


@pytest.mark.parametrize("kind", ["butterworth", "savgol", "gaussian"])
@pytest.mark.parametrize("order", [None, 8])
@pytest.mark.parametrize("cutoff_hz", [0.1, 2.0, 23.9])
def test_the_shortest_signals_that_a_filter_takes(kind, order, cutoff_hz):
    low_pass = LowPass(kind, cutoff_hz, None if kind == "gaussian" else order)
    count = low_pass.shortest(60.0)
    values = np.random.default_rng(0).normal(size=(count, 2))
    filtered = smooth(values, 60.0, low_pass)
    assert filtered.shape == (count, 2)
    assert np.isfinite(filtered).all() and not np.array_equal(filtered, values)
    np.testing.assert_array_equal(smooth(values[1:], 60.0, low_pass), values[1:])


def test_no_filter_changes_nothing():
    values = np.random.default_rng(0).normal(size=(60, 2))
    assert smooth(values, 60.0, LowPass("none")) is values
