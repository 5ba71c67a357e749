"""Samples that explain a frame as starts of hypotheses."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tree.sample_proposer import SampleProposer, find_samples
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_at,
    performed,
    poses_of,
    silhouette,
)

CAMERA = camera_at((0.3, -4.0, 1.3), size=(320, 240))
POSE = poses_of(performed("wave"))[20]
DIFFERENT_M = 0.07


@pytest.fixture(scope="module")
def surface():
    return Surface(body(), 100)


def proposed(library, root=None):
    proposer = SampleProposer(library, CAMERA, CpuBackend(), root, DIFFERENT_M)
    assert proposer.model is library.model
    person = Person(silhouette(body(), POSE, CAMERA), False)
    (found,) = proposer.propose([proposer.note(0.1, person)], [person], True)
    return found


@pytest.fixture(scope="module")
def proposal(library):
    """Of one frame."""
    return proposed(library)


def test_a_frame_is_kept_without_its_pictures(proposal):
    assert proposal.window is None and 20 < len(proposal.samples.root_m) <= 150
    away = np.linalg.norm(POSE.root_m - CAMERA.center_m)
    assert proposal.distance_m == pytest.approx(away, rel=0.1)


def test_seeds_are_the_likeliest_samples(proposal, surface, library):
    """All of them differ from each other, and each begins with a pose of the library."""
    starts = proposal.starts(surface, None)
    joints = np.stack([joints_at(body(), start.pose) for start in starts])
    apart = np.linalg.norm(joints[:, None] - joints, axis=-1).mean(-1)
    assert (apart[~np.eye(len(apart), dtype=bool)] > DIFFERENT_M).all()
    assert 4 < len(starts) <= 16
    mask = silhouette(body(), POSE, CAMERA)
    first = find_samples(library, CAMERA, mask, CpuBackend()).poses([0])
    np.testing.assert_allclose(starts[0].pose.angles_rad, first.angles_rad[0])
    np.testing.assert_allclose(starts[0].pose.root_m, first.root_m[0])
    sigma = np.r_[[0.06] * 3, [0.15] * 3, [0.2] * body().dof_count]
    for start in starts:
        assert start.prior.pose is start.pose and start.landmark_prior is None
        assert start.prior.sigma == pytest.approx(sigma)


def test_a_root_that_stands_still_is_every_seeds(proposal, surface, library):
    root = Pose(np.array([0.1, 0.2, 0.9]), POSE.root_rotation, POSE.angles_rad)
    free = proposal.starts(surface, None)
    held = replace(proposal, root=root).starts(surface, None)
    assert len(held) == len(free)
    for own, other in zip(held, free, strict=True):
        assert own.pose.root_m is root.root_m and own.pose.root_rotation is root.root_rotation
        np.testing.assert_array_equal(own.pose.angles_rad, other.pose.angles_rad)
        assert own.prior.sigma[:6] == pytest.approx(pose_step_sigma(body().tree)[:6])
    away = np.linalg.norm(root.root_m - CAMERA.center_m)
    assert proposed(library, root).distance_m == pytest.approx(away)


def test_nobody_knows_which_poses_are_usual(proposal):
    joints = np.random.default_rng(0).normal(size=(3, 15, 3))
    assert proposal.cost(joints).tolist() == [0, 0, 0]
    assert proposal.nearest(joints[0]) is None
