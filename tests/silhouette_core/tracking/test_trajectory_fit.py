"""Poses of consecutive frames, refined together."""

from copy import deepcopy
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.kinematics import centres_of
from silhouette_core.motion.pose import JointTarget, Pose
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import RefineSettings
from silhouette_core.refinement.surface import Surface
from silhouette_core.tracking import trajectory_fit
from silhouette_core.tracking.trajectory_fit import FrameEvidence, _Banded, fit_trajectory
from silhouette_core.tuning import TRAJECTORY
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_at,
    performed,
    poses_of,
    prior_at,
    silhouette,
)

CAMERA = camera_at((0.8, -3.6, 2.6))
VIEWS = PinholeViews.from_rig(Rig((CAMERA,)))
SURFACE = Surface(body(), 400)
MODEL = SURFACE.model
NOISE_M = 0.06


@pytest.fixture(scope="module")
def walk():
    """Frames whose priors are wrong by 6 cm, each by itself, and true poses."""
    poses = poses_of(performed("walk"))[5:20]
    rng = np.random.default_rng(0)
    frames = []
    for t, pose in enumerate(poses):
        seen = Observation.from_masks(VIEWS, [silhouette(MODEL, pose, CAMERA)])
        joints = joints_at(MODEL, pose) + rng.normal(0, NOISE_M, (15, 3))
        frames.append(FrameEvidence(seen, t / 30, prior_at(joints, NOISE_M)))
    return frames, poses


def joints_of(poses: list[Pose]) -> np.ndarray:
    return np.stack([joints_at(MODEL, pose) for pose in poses])


def fitted(walk, **numbers) -> np.ndarray:
    frames, poses = walk
    rng = np.random.default_rng(1)
    size = 6 + MODEL.dof_count
    starts = [pose.moved(0.03 * rng.standard_normal(size)).clipped() for pose in poses]
    with patch.object(trajectory_fit, "TRAJECTORY", replace(TRAJECTORY, **numbers)):
        return joints_of(fit_trajectory(SURFACE, frames, starts, True))


def error_m(walk, joints: np.ndarray) -> float:
    return float(np.linalg.norm(joints - joints_of(walk[1]), axis=-1).mean())


def jitter_m(joints: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1).mean())


def test_frames_decide_together_what_one_leaves_open(walk):
    alone = fitted(walk, acceleration=1e3, foot_m=1e3)
    together = fitted(walk)
    assert error_m(walk, together) < 0.8 * error_m(walk, alone)
    assert jitter_m(together) < 0.4 * jitter_m(alone)


def test_a_standing_foot_stands(walk):
    truth, ankles = joints_of(walk[1]), [3, 6]
    still = np.linalg.norm(np.diff(truth[:, ankles], axis=0), axis=-1) < 0.01
    assert still.sum() > 5

    def slip(joints):
        return np.linalg.norm(np.diff(joints[:, ankles], axis=0), axis=-1)[still].mean()

    assert slip(fitted(walk)) < 0.8 * slip(fitted(walk, foot_m=1e3))


def test_a_joint_is_where_it_was_set_and_the_frames_beside_follow(walk):
    frames, poses = walk
    wrist, offset_m = LANDMARK_NAMES.index("left_wrist"), np.array([0.0, 0.0, 0.08])
    place = centres_of(MODEL, fit_trajectory(SURFACE, frames, poses, True))[7, wrist] + offset_m
    held = [*frames]
    held[7] = replace(frames[7], targets=[JointTarget("left_wrist", 7, tuple(place))])
    free, bound = (
        centres_of(MODEL, fit_trajectory(SURFACE, each, poses, True)) for each in (frames, held)
    )
    far_m = np.linalg.norm(bound - free, axis=-1)
    assert np.linalg.norm(bound[7, wrist] - place) < 0.02
    assert 0.02 < far_m[6, wrist] < far_m[7, wrist] and far_m[0].max() < 0.02


def test_the_floor_decides_the_distance(walk):
    frames, poses = walk
    away = joints_of(poses)[:, 0] - CAMERA.center_m
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    # Everything is expected 15 cm too far away, and the contour hardly counts.
    precision = np.eye(3) / 0.15**2
    wrong, far = [], []
    for frame, pose, off_m in zip(frames, poses, 0.15 * away, strict=True):
        prior = frame.landmark_prior
        prior = replace(prior, pelvis_m=prior.pelvis_m + off_m, pelvis_precision=precision)
        wrong.append(replace(frame, landmark_prior=prior))
        far.append(pose.moved(np.r_[off_m, np.zeros(57)]))

    def distance_error(floor):
        faint = partial(RefineSettings, independence=0.005)
        with patch.object(trajectory_fit, "RefineSettings", faint):
            found = fit_trajectory(SURFACE, wrong, far, floor)
        gap = joints_of(found)[:, 0] - joints_of(poses)[:, 0]
        return abs(float((gap * away).sum(axis=1).mean()))

    assert distance_error(True) < 0.85 * distance_error(False)


def test_banded_equations_are_solved_as_dense_ones():
    rng = np.random.default_rng(3)
    count, size = 5, 4
    banded, dense = _Banded(count, size), np.zeros((count * size,) * 2)
    for row in range(count):
        for column in range(max(row - 2, 0), row + 1):
            block = rng.normal(size=(size, size))
            if row == column:
                block = block @ block.T + 20 * np.eye(size)
            banded.add(row, column, block)
            rows, columns = (slice(k * size, (k + 1) * size) for k in (row, column))
            dense[rows, columns] += block
            if row != column:
                dense[columns, rows] += block.T
    banded.gradient[:] = rng.normal(size=(count, size))
    dense += 1e-6 * np.eye(len(dense))
    gradient = banded.gradient.ravel().copy()
    low, high = np.full((2, count, size), -np.inf) * [[[1]], [[-1]]]
    expected = -np.linalg.solve(dense, gradient)
    assert deepcopy(banded).solve(low, high).ravel() == pytest.approx(expected, rel=1e-6)
    # What is held at its bound changes what is best for the others.
    low[1], high[3] = 0.01, -0.01
    found = deepcopy(banded).solve(low, high)
    assert (found[1] >= 0.01).all() and (found[3] <= -0.01).all()
    held = ((found == low) | (found == high)).ravel()
    slope = dense @ found.ravel() + gradient
    assert held.any() and np.abs(slope[~held]).max() < 1e-6


def test_a_single_frame_and_a_pair_are_fitted_as_well(walk):
    frames, poses = walk
    for count in (1, 2):
        found = fit_trajectory(SURFACE, frames[:count], poses[:count], True)
        assert len(found) == count
        gap = np.linalg.norm(joints_of(found) - joints_of(poses[:count]), axis=-1)
        assert gap.mean() < 0.75 * NOISE_M * np.sqrt(8 / np.pi)


def test_a_frame_of_wrong_silhouettes_counts_for_as_little_as_it_says(walk):
    """One frame shows somebody else: with a large scale the frames beside it decide."""
    frames, poses = walk
    other = Observation.from_masks(VIEWS, [silhouette(MODEL, poses[0], CAMERA)])

    def gap_m(scale):
        middle = replace(frames[7], observation=other, landmark_prior=None, scale=scale)
        found = fit_trajectory(SURFACE, [*frames[:7], middle, *frames[8:]], poses, True)
        return np.linalg.norm(joints_of(found)[7] - joints_of(poses)[7], axis=-1).mean()

    assert gap_m(8.0) < 0.7 * gap_m(1.0)
