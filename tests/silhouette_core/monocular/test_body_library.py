"""A body that is no person's as one camera sees it: its distance, its library, its root."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from examples.bodies.example_bodies import desk_lamp, robot_arm
from examples.bodies.example_motions import example_motion
from silhouette_core.monocular.body_library import (
    SomeSilhouettes,
    _from_one_side,
    body_of_track,
    library_of_body,
)
from silhouette_core.monocular.making.base_poses import base_poses
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.making.sampled_motion import sampled_motion
from silhouette_core.monocular.person import Person, area_distance
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tracking.pose_costs import PoseCosts
from silhouette_core.monocular.tree.forward import ForwardFilter
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.root_search import find_root
from silhouette_core.monocular.tree.store import write_library
from silhouette_core.monocular.tree.view_tree_filter import tree_filter
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import SilentReporter
from silhouette_core.scoring.cpu import CPU
from tests.silhouette_core.monocular.filming import camera_at, poses_of, silhouette

CAMERA = camera_at((1.0, -1.6, 1.1), (0.0, -0.1, 0.3))
PITCH_DEG = 23.0
SETTINGS = LibrarySettings(
    150 * 12, yaw_step_deg=30, pitches_deg=(PITCH_DEG,), mirror=False, proposal=False, tree="views"
)


@pytest.fixture(scope="module")
def library():
    """The lamp in 150 poses from 12 sides."""
    motion = sampled_motion(desk_lamp(), np.random.default_rng(0), 3000)
    return build_library(base_poses({"sampled": motion}, SETTINGS), motion.model, SETTINGS)


@pytest.fixture(scope="module")
def filmed():
    """True poses of the lamp, and their silhouettes."""
    poses = poses_of(example_motion("desk_lamp", 30))
    return poses, [silhouette(desk_lamp(), pose, CAMERA) for pose in poses]


def test_a_smaller_silhouette_is_farther_away():
    mask = np.zeros(CAMERA.size[::-1], bool)
    mask[100:140, 100:160] = True
    near = area_distance(CAMERA, mask, 0.24)
    assert near == pytest.approx(CAMERA.matrix[0, 0] * 0.1 / 10, rel=1e-6)
    mask[120:] = False
    assert area_distance(CAMERA, mask, 0.24) == pytest.approx(near * np.sqrt(2))


def test_the_distance_of_a_body_is_found_by_its_silhouettes_area(library, filmed):
    poses, masks = filmed
    tree = tree_filter(library, True, 1 / 15)
    frame = ForwardFilter(tree, CAMERA).step(0, 0.0, Person(masks[0], False))
    true_m = np.linalg.norm(poses[0].root_m - CAMERA.center_m)
    assert frame.distance_m == pytest.approx(true_m, rel=0.2)


def test_poses_from_one_side_look_as_the_camera_sees_them(library, filmed):
    pose, mask = filmed[0][7], filmed[1][7]
    given = replace(library, base_angles=np.array([pose.angles_rad] * 2, np.float32))
    seen = _from_one_side(given, False, CAMERA, pose)
    assert len(seen) == len(seen.views) * 2 == 2
    distance_m = float(np.linalg.norm(pose.root_m - CAMERA.center_m))
    window = look_at(CAMERA, mask, distance_m, STATURE_PX / desk_lamp().length_m)
    drawn = seen.render(np.array([0])).windows[0] > 0
    assert (drawn & window.mask).sum() / (drawn | window.mask).sum() > 0.8


@pytest.mark.slow
def test_a_still_root_is_found_by_frames_of_one_camera(library, filmed):
    poses, masks = filmed
    root = find_root(tree_filter(library, False, 1.0), CAMERA, masks[::5])
    assert np.linalg.norm(root.root_m - poses[0].root_m) < 0.06
    turn = Rotation.from_matrix(root.root_rotation @ poses[0].root_rotation.T).magnitude()
    assert np.degrees(turn) < 10


def test_what_is_known_about_people_costs_other_bodies_nothing(library, filmed):
    costs, poses = PoseCosts(library), filmed[0][:2]
    joints = np.random.default_rng(0).normal(size=(2, 5, 3))
    assert not costs.novelty(poses, joints).any() and not costs.slip(joints, joints + 1, 1).any()
    for t in range(12):
        costs.add_position(t / 15, np.array([0.2 * t, 0, 0]))
    assert not costs.walking_backward(poses, 0.8).any()


def test_a_held_root_is_the_one_of_all_hypotheses(library, filmed):
    poses, masks = filmed
    root = Pose(poses[0].root_m, poses[0].root_rotation, np.zeros(4))
    settings = TrackerSettings().of_given_body(desk_lamp().length_m, root)
    tree = tree_filter(library, True, 1 / 15)
    tracker = HypothesisTracker(tree, CAMERA, settings)
    frame = ForwardFilter(tree, CAMERA).step(0, 0.0, Person(masks[0], False))
    beam = tracker.step(frame, None, None)
    for pose in beam.poses:
        np.testing.assert_allclose(pose.root_m, root.root_m, atol=1e-4)
        np.testing.assert_allclose(pose.root_rotation, root.root_rotation, atol=1e-4)
    assert beam.joints.shape[1:] == (5, 3)
    # Hypotheses that are known already are added, and can be all.
    again = tracker.step(frame, None, None, known=beam, searched=False)
    assert len(again.poses) == len(beam.poses) and again.distance == pytest.approx(beam.distance)


def test_a_library_of_another_body_is_refused(library, filmed, tmp_path):
    path = tmp_path / "lamp.vplib"
    write_library(library, path)
    assert body_of_track("", "", SilentReporter()) is None
    model = body_of_track("", str(path), SilentReporter())
    assert model is not None and model.names == desk_lamp().names
    shown = SomeSilhouettes(CAMERA, filmed[1][:1])
    with pytest.raises(InputError, match=r"lamp\.vplib is the library of a body with other parts"):
        library_of_body(robot_arm(), str(path), shown, CPU, SilentReporter())
