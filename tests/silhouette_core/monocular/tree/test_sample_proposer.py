"""Samples of the filter as starts of hypotheses."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tree.forward import ForwardFilter, candidates_of
from silhouette_core.monocular.tree.sample_proposer import SampleProposer
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_of,
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


@pytest.fixture(scope="module")
def proposal(tree):
    """Of one frame."""
    proposer = SampleProposer(ForwardFilter(tree, CAMERA), None, DIFFERENT_M)
    assert proposer.model is tree.library.model
    person = Person(silhouette(body(), POSE, CAMERA), False)
    (found,) = proposer.propose([proposer.note(0.1, person)], [person], True)
    return found


def joints_at(starts):
    return np.stack([joints_of(body(), start.pose) for start in starts])


def reordered(proposal, probability, distance):
    """The same samples, ordered by another probability, and other distances."""
    posterior, order = proposal.frame.posterior, np.argsort(-probability, kind="stable")
    changed = replace(
        posterior,
        samples=posterior.samples[order],
        probability=probability[order],
        distance=distance[order],
        scale=posterior.scale[order],
        shift_px=posterior.shift_px[order],
    )
    return replace(proposal, frame=replace(proposal.frame, posterior=changed))


def test_a_frame_is_kept_without_its_pictures(proposal):
    frame = proposal.frame
    assert all(one.mask.size == 0 for one in frame.windows)
    assert proposal.window is None
    away = np.linalg.norm(POSE.root_m - CAMERA.center_m)
    assert proposal.distance_m == frame.distance_m == pytest.approx(away, rel=0.1)


def test_seeds_are_the_likeliest_samples_then_those_that_fit_best(proposal, surface, tree):
    """All of them differ from each other, and each begins with a pose of the library."""
    starts = proposal.starts(surface, None)
    joints = joints_at(starts)
    apart = np.linalg.norm(joints[:, None] - joints, axis=-1).mean(-1)
    assert (apart[~np.eye(len(apart), dtype=bool)] > DIFFERENT_M).all()
    assert 8 < len(starts) <= 16
    first = candidates_of(tree, proposal.frame, [0])
    np.testing.assert_allclose(starts[0].pose.angles_rad, first.angles_rad[0])
    np.testing.assert_allclose(starts[0].pose.root_m, first.root_m[0])
    sigma = np.r_[[0.06] * 3, [0.15] * 3, [0.2] * body().dof_count]
    for start in starts:
        assert start.prior.pose is start.pose and start.landmark_prior is None
        assert start.prior.sigma == pytest.approx(sigma)


def test_what_fits_best_is_a_seed_however_improbable(proposal, surface, tree):
    """One pose is improbable and fits best, as after a wrong turn of the filter."""
    posterior = proposal.frame.posterior
    rows = np.arange(len(posterior.samples))
    poses = candidates_of(tree, proposal.frame, rows)
    joints = landmarks(body(), *place(body(), poses.root_m, poses.root_rotation, poses.angles_rad))
    chosen = int(np.linalg.norm(joints - joints[0], axis=-1).mean(-1).argmax())
    for fits in (False, True):
        probability = np.where(rows == chosen, 0.0, 1 / (1 + rows))
        distance = 0.1 + 0.001 * rows
        distance[chosen] = 0.01 if fits else 9.0
        seeds = joints_at(reordered(proposal, probability, distance).starts(surface, None))
        found = np.abs(seeds - joints[chosen]).max(axis=(1, 2)).min() < 1e-9
        assert found == fits
        # Likeliest first, though another one fits better.
        first = joints[np.argsort(-probability, kind="stable")[0]]
        assert np.abs(seeds[0] - first).max() < 1e-9


def test_a_root_that_stands_still_is_every_seeds(proposal, surface):
    root = Pose(np.array([0.1, 0.2, 0.9]), POSE.root_rotation, POSE.angles_rad)
    held = replace(proposal, root=root).starts(surface, None)
    free = proposal.starts(surface, None)
    assert len(held) == len(free)
    for own, other in zip(held, free, strict=True):
        assert own.pose.root_m is root.root_m and own.pose.root_rotation is root.root_rotation
        np.testing.assert_array_equal(own.pose.angles_rad, other.pose.angles_rad)
        assert own.prior.sigma[:6] == pytest.approx(pose_step_sigma(body().tree)[:6])


def test_nobody_knows_which_poses_are_usual(proposal):
    joints = np.random.default_rng(0).normal(size=(3, 15, 3))
    assert proposal.cost(joints).tolist() == [0, 0, 0]
    assert proposal.nearest(joints[0]) is None
