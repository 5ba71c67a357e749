"""Refined poses per frame, and the past that leads to them."""

import numpy as np
import pytest

from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.filter.forward import ForwardFilter
from silhouette_core.filter.hypothesis_tracker import (
    Beam,
    HypothesisTracker,
    TrackerSettings,
    backtrack,
)
from silhouette_core.filter.person import Person
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from tests.silhouette_core.filter.filming import body, camera_at, performed, poses_of, silhouette

CAMERA = camera_at((-0.8, -3.9, 1.3))
STEP_S = 0.1


@pytest.fixture(scope="module")
def followed(tree):
    """Somebody of another build swings both arms: tracks, states and the true joints of every
    frame.
    """
    other = body(0.7 * SHAPE_SIGMA * np.random.default_rng(4).standard_normal(len(SHAPE_SIGMA)))
    poses = poses_of(performed("arm swing both", other))[10:40:3]
    filter_, tracks = (
        ForwardFilter(tree, CAMERA),
        HypothesisTracker(tree, CAMERA, TrackerSettings()),
    )
    states: list[Beam] = []
    for k, pose in enumerate(poses):
        filter_frame = filter_.step(k, STEP_S * k, Person(silhouette(other, pose, CAMERA), False))
        states.append(tracks.step(filter_frame, *([None, None, *states][:-3:-1])))
    truth = landmarks(
        other,
        *forward(
            other,
            *(
                np.stack([f(pose) for pose in poses])
                for f in (root, turn, lambda pose: pose.angles_rad)
            ),
        ),
    )
    return tracks, states, truth


def root(pose):
    return pose.root_m


def turn(pose):
    return quaternions(pose.root_rotation[None])[0]


def test_the_course_follows_the_motion(followed):
    _, states, truth = followed
    result = np.stack([frame.joints[k] for frame, k in zip(states, backtrack(states), strict=True)])
    apart = np.linalg.norm((result - result[:, :1]) - (truth - truth[:, :1]), axis=-1)
    assert 1000 * apart.mean() < 90
    assert np.linalg.norm(result[:, 0] - truth[:, 0], axis=-1).mean() < 0.25


def test_costs_are_counted_from_the_best_and_pasts_exist(followed):
    tracks, states, _ = followed
    for before, frame in zip([None, *states], states, strict=False):
        assert 1 <= len(frame.poses) <= tracks.settings.kept == TrackerSettings().kept
        assert frame.cost.min() == 0 and (np.diff(frame.cost) >= 0).all()
        assert (
            (frame.back == -1).all()
            if before is None
            else ((frame.back >= 0) & (frame.back < len(before.poses))).all()
        )
        low, high = tracks.model.dof_limits_rad.T
        assert all(
            ((pose.angles_rad >= low - 1e-6) & (pose.angles_rad <= high + 1e-6)).all()
            for pose in frame.poses
        )


def test_kept_poses_differ(followed):
    _, states, _ = followed
    for frame in states:
        apart = np.linalg.norm(frame.joints[:, None] - frame.joints[None], axis=-1).mean(-1)
        assert (apart[~np.eye(len(apart), dtype=bool)] > 0.01).all()
    assert max(len(frame.poses) for frame in states) > 3


def test_a_course_may_end_elsewhere_than_at_the_best(followed):
    _, states, _ = followed
    worst = len(states[-1].poses) - 1
    trajectory = backtrack(states, worst)
    assert trajectory[-1] == worst
    for k in range(len(states) - 1, 0, -1):
        assert states[k].back[trajectory[k]] == trajectory[k - 1]


def test_unrefined_poses_are_the_librarys(tree, library):
    pose = poses_of(performed("walk"))[12]
    filter_frame = ForwardFilter(tree, CAMERA).step(
        0, 0.0, Person(silhouette(body(), pose, CAMERA), False)
    )
    states = HypothesisTracker(tree, CAMERA, TrackerSettings(refine=False)).step(
        filter_frame, None, None
    )
    for own in states.poses:
        assert np.abs(library.base_angles - own.angles_rad).max(1).min() < 1e-6
