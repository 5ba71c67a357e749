"""Joints' positions as a prior of the refinement."""

import numpy as np
import pytest

from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.landmark_prior import (
    add_landmark_priors,
    landmark_arrays,
    landmark_jacobian,
)
from silhouette_core.refinement.refine import RefineSettings, refine
from silhouette_core.refinement.surface import Surface
from tests.silhouette_core.monocular.filming import body, joints_at, performed, poses_of, prior_at

SURFACE = Surface(body(), 200)
MODEL = SURFACE.model


def random_step(seed: int, size: float) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(6 + MODEL.dof_count)


def test_jacobian_against_differences():
    pose, step = poses_of(performed("squat"))[15], random_step(0, 1e-6)
    before, after = (joints_at(MODEL, one) for one in (pose, pose.moved(step)))
    change = landmark_jacobian(MODEL, SURFACE.posed(pose)) @ step
    assert change == pytest.approx(after - before, abs=1e-10)


def test_the_gradient_is_that_of_students_t():
    pose = poses_of(performed("walk"))[8]
    prior = prior_at(joints_at(MODEL, pose.moved(random_step(1, 0.05))), 0.05)

    def energy(one: Pose) -> float:
        landmarks = joints_at(MODEL, one)
        error = (landmarks - landmarks[0] - prior.relative_m)[1:] / 0.05
        pelvis = (landmarks[0] - prior.pelvis_m) / 0.05
        return 3.5 * np.log1p((error**2).sum(axis=1) / 4).sum() + 0.5 * (pelvis**2).sum()

    size = 6 + MODEL.dof_count
    matrix, gradient = np.zeros((1, size, size)), np.zeros((1, size))
    posed = SURFACE.posed_many(PoseArrays.from_poses([pose]))
    add_landmark_priors(matrix, gradient, MODEL, posed, landmark_arrays([prior]))
    step = random_step(2, 1e-5)
    slope = (energy(pose.moved(step)) - energy(pose.moved(-step))) / 2
    assert gradient[0] @ step == pytest.approx(slope, rel=1e-3)
    assert np.linalg.eigvalsh(matrix[0]).min() > -1e-6


def test_without_a_contour_the_joints_go_where_they_are_expected():
    pose = poses_of(performed("reach aside"))[25]
    settings = RefineSettings(reaches_m=(0.0,) * 15, usual=0.01)
    start = pose.moved(random_step(3, 0.1)).clipped()
    wanted = joints_at(MODEL, pose)
    prior = prior_at(wanted, 0.01)
    refined = refine(SURFACE, None, start, None, settings, prior).pose  # type: ignore[arg-type]
    assert np.linalg.norm(joints_at(MODEL, refined) - wanted, axis=1).max() < 0.005
