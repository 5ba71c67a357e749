"""A body that is no person's as one camera sees it: its distance, its library, its root."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from examples.bodies.example_bodies import desk_lamp, robot_arm
from examples.bodies.example_motions import example_motion
from silhouette_core.monocular.body_library import (
    _from_one_side,
    body_of_track,
    library_of_body,
    sampled_motion,
)
from silhouette_core.monocular.occlusion import usual_areas
from silhouette_core.monocular.person import Person, area_distance
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.root_search import find_root
from silhouette_core.monocular.tree.sample_proposer import SampleProposer, find_samples
from silhouette_core.monocular.tree.store import write_library
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import SilentReporter
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at, poses_of, silhouette

CAMERA = camera_at((1.0, -1.6, 1.1), (0.0, -0.1, 0.3))
PITCH_DEG = 23.0
SETTINGS = LibrarySettings(150 * 12, yaw_step_deg=30, pitches_deg=(PITCH_DEG,), mirror=False)


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
    found = find_samples(library, CAMERA, masks[0], CpuBackend())
    true_m = np.linalg.norm(poses[0].root_m - CAMERA.center_m)
    assert found.distance_m == pytest.approx(true_m, rel=0.2)


def test_poses_from_one_side_look_as_the_camera_sees_them(library, filmed):
    pose, mask = filmed[0][7], filmed[1][7]
    bases = replace(library.bases, angles=np.array([pose.angles_rad] * 2, np.float32))
    seen = _from_one_side(replace(library, bases=bases), False, CAMERA, pose)
    assert len(seen) == len(seen.views) * 2 == 2
    distance_m = float(np.linalg.norm(pose.root_m - CAMERA.center_m))
    window = look_at(CAMERA, mask, distance_m, STATURE_PX / desk_lamp().length_m)
    drawn = seen.render(np.array([0])).windows[0] > 0
    assert (drawn & window.mask).sum() / (drawn | window.mask).sum() > 0.8


@pytest.mark.slow
def test_a_still_root_is_found_by_frames_of_one_camera(library, filmed):
    poses, masks = filmed
    root = find_root(library, CAMERA, masks[::5], CpuBackend())
    assert np.linalg.norm(root.root_m - poses[0].root_m) < 0.06
    turn = Rotation.from_matrix(root.root_rotation @ poses[0].root_rotation.T).magnitude()
    assert np.degrees(turn) < 10


def test_a_held_root_is_the_one_of_all_hypotheses(library, filmed):
    poses, masks = filmed
    root = Pose(poses[0].root_m, poses[0].root_rotation, np.zeros(4))
    model, person = desk_lamp(), Person(masks[0], False)
    settings = TrackerSettings.of_given_body(model.length_m)
    proposer = SampleProposer(library, CAMERA, CpuBackend(), root, settings.different_m)
    (proposal,) = proposer.propose([proposer.note(0.0, person)], [person], True)
    tracker = HypothesisTracker(model, CAMERA, usual_areas(library.areas), settings, CpuBackend())
    observed = tracker.observe(masks[0], proposal.distance_m, 0.0)
    beam = tracker.step(observed, proposal, (None, None))
    assert len(beam.poses) > 1 and set(beam.priors) == {None}
    for pose in beam.poses:
        np.testing.assert_allclose(pose.root_m, root.root_m, atol=1e-4)
        np.testing.assert_allclose(pose.root_rotation, root.root_rotation, atol=1e-4)
    assert beam.joints.shape[1:] == (5, 3)


def test_a_library_of_another_body_is_refused(library, filmed, tmp_path):
    path = tmp_path / "lamp.vplib"
    write_library(library, path)
    assert body_of_track("", "", SilentReporter()) is None
    model = body_of_track("", str(path), SilentReporter())
    assert model is not None and model.names == desk_lamp().names
    shown = CAMERA, filmed[1][:1]
    with pytest.raises(InputError, match=r"lamp\.vplib is the library of a body with other parts"):
        library_of_body(robot_arm(), str(path), shown, CpuBackend(), SilentReporter())
