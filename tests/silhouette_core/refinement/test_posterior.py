"""Standard deviations of the joints, by the outlines."""

import numpy as np
import pytest

from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import PoseArrays
from silhouette_core.refinement.posterior import landmark_sigma_m
from silhouette_core.refinement.refine import RefineSettings, free_unknowns, refine
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import fitting_model, observe, stance, views

MODEL = fitting_model()
SURFACE = Surface(MODEL, 600)
POSE = stance(MODEL, {"left_upper_arm.abduction": 20.0})


def joints_of(poses):
    return landmarks(MODEL, *place(MODEL, *PoseArrays.from_poses(poses).arrays))


def test_it_is_the_spread_of_poses_drawn_from_the_normal_equations():
    seen = observe(views(4), MODEL, POSE)
    found = landmark_sigma_m(SURFACE, seen, POSE)
    free = free_unknowns(MODEL)
    last = RefineSettings(reaches_m=(0.05,))
    matrix = refine(SURFACE, seen, POSE, settings=last).normal_matrix[np.ix_(free, free)]
    steps = np.zeros((4000, 6 + MODEL.dof_count))
    # A tenth of a standard deviation: the joints then move in proportion.
    draws = np.random.default_rng(0).normal(size=(len(steps), len(free)))
    steps[:, free] = 0.1 * np.linalg.solve(np.linalg.cholesky(matrix).T, draws.T).T
    joints = joints_of([POSE.moved(step) for step in steps])
    spread = 10 * np.sqrt(joints.var(axis=0).sum(axis=1))
    assert found == pytest.approx(spread, rel=0.06)


def test_fewer_cameras_leave_more_open():
    few, many = (
        landmark_sigma_m(SURFACE, observe(views(count), MODEL, POSE), POSE) for count in (2, 6)
    )
    assert (many < few).all()
    assert np.median(few / many) > 1.3
