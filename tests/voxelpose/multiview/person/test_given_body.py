"""Search for bodies that are no person's, and a root that stands still."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from examples.bodies.example_motions import example_motion
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigid_parts import Box, Capsule, body_of_parts
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import SilentReporter
from silhouette_core.refinement.posterior import still_root
from silhouette_core.refinement.refine import PosePrior, RefinedPose, RefineSettings, RefineStart
from tests.voxelpose.multiview.matching_scenes import hull, joint_errors_m, photograph, views
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person import body_choice
from voxelpose.multiview.person.body_choice import start_given
from voxelpose.multiview.proposers.pose_search import (
    SEARCHED,
    BodyGeometry,
    PoseFit,
    find_pose,
    refine_fits,
)

VOXEL_M = 0.03


def frame_of(model: BodyModel, truth: Pose) -> FrameObservation:
    seen_by = views()
    return FrameObservation(
        seen_by, photograph(seen_by, model, truth), *hull(seen_by, model, truth, VOXEL_M)
    )


def pose_of(motion, t: int) -> Pose:
    rotation = motion.parts()[0][t, 0]
    return Pose(motion.root_m[t], rotation, motion.angles_rad[t])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robot_arm", "quadruped", "desk_lamp"])
def test_a_body_is_found_anywhere_without_a_prior(name):
    motion = example_motion(name, 20)
    truth = pose_of(motion, 13)
    body = BodyGeometry.from_model(motion.model, VOXEL_M, "cpu")
    found = find_pose(body, frame_of(motion.model, truth), count=6)
    assert joint_errors_m(motion.model, found[0].pose, motion.model, truth).mean() < 0.02
    assert found[0].error < 0.06 and not found[0].stopped


def moved_root(pose: Pose, shift_m, turn_deg: float) -> Pose:
    turn = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    return Pose(pose.root_m + shift_m, turn @ pose.root_rotation, pose.angles_rad)


@pytest.mark.slow
def test_a_still_root_is_placed_by_all_frames_together():
    motion = example_motion("robot_arm", 31)
    poses = [pose_of(motion, t) for t in (0, 15, 30)]
    frames = [frame_of(motion.model, pose) for pose in poses]
    body = BodyGeometry.from_model(motion.model, VOXEL_M, "cpu")
    starts = [
        moved_root(pose, np.array([0.03, -0.02, 0.01]) * k, 3.0 * k)
        for k, pose in enumerate(poses, -1)
    ]
    seen = [frame.observation for frame in frames]
    root = still_root(body.surface, seen, starts, SEARCHED)
    assert np.linalg.norm(root.root_m - poses[0].root_m) < 0.004
    turn = Rotation.from_matrix(root.root_rotation.T @ poses[0].root_rotation).magnitude()
    assert np.degrees(turn) < 0.8


def test_a_held_root_stays_where_it_is_whatever_a_start_says():
    motion = example_motion("robot_arm", 2)
    truth = pose_of(motion, 1)
    frame = frame_of(motion.model, truth)
    body = replace(BodyGeometry.from_model(motion.model, VOXEL_M, "cpu"), root=truth)
    start = moved_root(truth, np.array([0.2, 0.1, 0.0]), 20.0)
    prior = PosePrior(start, np.full(6 + motion.model.dof_count, 0.1))
    settings = RefineSettings(reaches_m=(0.1, 0.08))
    for begun in (RefineStart(start, settings), RefineStart(start, settings, prior)):
        (fit,) = refine_fits(body, frame.observation, [begun])
        np.testing.assert_allclose(fit.pose.root_m, truth.root_m, atol=1e-4)
        np.testing.assert_allclose(fit.pose.root_rotation, truth.root_rotation, atol=1e-4)
    assert prior.pose is start and prior.sigma.min() == 0.1


def test_a_rigid_object_without_joints_is_found():
    tree = KinematicTree.from_parts((("case", "", ()),))
    shapes = [
        Box((-0.3, -0.15, -0.1), (0.3, 0.15, 0.1)),
        Capsule((0.3, 0.1, 0.1), (0.3, 0.1, 0.4), 0.06),
    ]
    model = body_of_parts(tree, np.zeros((1, 3)), [shapes])
    turn = Rotation.from_euler("zx", [50, 20], degrees=True).as_matrix()
    truth = Pose(np.array([0.1, 0.2, 0.6]), turn, np.zeros(0))
    found = find_pose(
        BodyGeometry.from_model(model, VOXEL_M, "cpu"), frame_of(model, truth), count=6
    )
    assert np.linalg.norm(found[0].pose.root_m - truth.root_m) < 0.01
    apart = Rotation.from_matrix(found[0].pose.root_rotation.T @ turn).magnitude()
    assert np.degrees(apart) < 2


def hinged_box() -> BodyModel:
    hinge = (Dof("bend", (1.0, 0.0, 0.0), (-90.0, 90.0)),)
    tree = KinematicTree.from_parts((("case", "", ()), ("lid", "case", hinge)))
    joints = np.array([[0, 0, 0], [0, 0.2, 0.2]])
    shapes = [[Box((-0.2, -0.2, 0), (0.2, 0.2, 0.2))], [Box((-0.2, -0.2, 0.2), (0.2, 0.2, 0.25))]]
    return body_of_parts(tree, joints, shapes)


def test_roots_count_by_what_is_known_of_them_when_the_joints_may_turn(monkeypatch):
    r"""Of the second frame all is known ten times as well, but what turns the lid shifts it along
    z, too: :math:`S_{zz} = 10 - 9 \cdot 9 / 10 = 1.9`. A third frame is far away.
    """
    body = BodyGeometry.from_model(hinged_box(), VOXEL_M, "cpu")
    known = np.eye(7), 10 * np.eye(7), 1000 * np.eye(7)
    known[1][2, 6] = known[1][6, 2] = 9.0
    places = np.array([[0, 0, 0], [0.05, 0, 0.05], [3.0, 0, 0]])
    refined = [
        RefinedPose(Pose(place, np.eye(3), np.zeros(1)), matrix)
        for place, matrix in zip(places, known, strict=True)
    ]
    monkeypatch.setattr(
        "silhouette_core.refinement.posterior.refine", lambda surface, k, *_: refined[k]
    )
    root = still_root(body.surface, range(3), [one.pose for one in refined], SEARCHED)
    np.testing.assert_allclose(root.root_m, [0.05 * 10 / 11, 0, 0.05 * 1.9 / 2.9], atol=1e-9)
    np.testing.assert_allclose(root.root_rotation, np.eye(3), atol=1e-12)


def test_anchors_begin_where_they_explain_the_silhouettes_nearly_as_well_as_the_best(monkeypatch):
    errors = [0.10, 0.13, 0.15, 0.5, 0.12]
    still = Pose(np.zeros(3), np.eye(3), np.zeros(1))
    monkeypatch.setattr(
        body_choice, "find_pose", lambda body, frame, matching: [PoseFit(still, errors[frame])]
    )

    class Observations(list):
        observer = SimpleNamespace(voxel_size_m=VOXEL_M)
        there = np.ones(5, np.bool_)
        hidden = np.zeros(5)

        def observe(self, t):
            return t

    _, fits = start_given(
        Observations(range(5)), Settings(), MatchSettings(), SilentReporter(), hinged_box()
    )
    assert sorted(fits) == [0, 1, 4]
