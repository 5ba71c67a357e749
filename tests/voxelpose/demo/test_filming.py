"""The demo's recording: readable like any other, its truth consistent with what the cameras saw."""

import json

import cv2
import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.demo.room import make_recording
from voxelpose.recording.folder import Recording


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_recording(tmp_path_factory.mktemp("demo"), frames=3)


def test_it_opens_like_any_recording(folder):
    recording = Recording.open(folder)
    assert recording.rig.names == ("cam_1", "cam_2", "cam_3", "cam_4")
    assert recording.frame_count == 3 and recording.fps == 20
    assert recording.subject.stature_m == STATURE_M


def test_truth_lies_on_the_actor_in_every_view(folder):
    truth = json.loads((folder / "truth.json").read_text())
    assert set(truth["joints"]) == set(LANDMARK_NAMES)
    for camera in Recording.open(folder).rig:
        empty = (
            cv2.VideoCapture(str(folder / "background" / f"{camera.name}.mp4"))
            .read()[1]
            .astype(int)
        )
        seen = cv2.VideoCapture(str(folder / f"{camera.name}.mp4")).read()[1].astype(int)
        changed = cv2.dilate((np.abs(seen - empty).max(2) > 20).astype(np.uint8), np.ones((7, 7)))
        for name in set(LANDMARK_NAMES) - {"head_top"}:
            ((x, y),) = np.rint(camera.project(np.array(truth["joints"][name][:1]))[0]).astype(int)
            assert changed[y, x], (camera.name, name)


def test_actor_is_closed_rigid_and_on_the_floor():
    actor = Mannequin.build()
    mesh = trimesh.Trimesh(actor.vertices_m, actor.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert min(piece.volume for piece in mesh.split()) > 0
    lengths = []
    for time in np.linspace(0, 3, 13):
        vertices, joints = actor.pose(*performances()["three_seconds"].pose_at(time))
        assert abs(vertices[:, 2].min()) < 1e-9
        lengths.append(
            [
                np.linalg.norm(joints["left_hip"] - joints["left_knee"]),
                np.linalg.norm(joints["right_elbow"] - joints["right_wrist"]),
            ]
        )
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], (13, 2)), atol=1e-9)


def test_same_seed_same_pictures(folder, tmp_path):
    again = make_recording(tmp_path, frames=1)
    first, second = (
        cv2.VideoCapture(str(f / "background" / "cam_2.mp4")).read()[1] for f in (folder, again)
    )
    np.testing.assert_array_equal(first, second)


def test_mistakes_are_named(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="frames must be at least 1"):
        make_recording(tmp_path, frames=0)
    with pytest.raises(
        ValueError, match="no performance 'juggling': three_seconds, there_and_back, arm_swing"
    ):
        make_recording(tmp_path, performance="juggling")
    with pytest.raises(ValueError, match=r"cameras must be some of cam_1, .*, got cam_9"):
        make_recording(tmp_path, cameras=["cam_9"])
    monkeypatch.setattr(cv2.VideoWriter, "isOpened", lambda self: False, raising=False)
    with pytest.raises(InputError, match=r"cam_1\.mp4 cannot be written"):
        make_recording(tmp_path, frames=1)


def directions(performance: str, near: str, far: str, count: int = 120) -> np.ndarray:
    """Unit vectors from joint to joint over one round."""
    played, actor = performances()[performance], Mannequin.build()
    joints = [
        actor.pose(*played.pose_at(time))[1]
        for time in np.linspace(0, played.keys[-1, 0] - 1e-6, count)
    ]
    lines = np.array([pose[far] - pose[near] for pose in joints])
    return lines / np.linalg.norm(lines, axis=1, keepdims=True)


def test_arm_swings_24_times_in_profile_at_constant_speed(tmp_path):
    played = performances()["arm_swing"]
    assert (played.frames, played.fps, played.cameras) == (576, 15, ["cam_3"])
    folder = make_recording(tmp_path / "swing", frames=2, performance="arm_swing")
    recording = Recording.open(folder)
    assert recording.rig.names == ("cam_3",) and recording.fps == 15
    hips = directions("arm_swing", "left_hip", "right_hip", 3)[0]
    (camera,) = recording.rig
    towards = -camera.rotation.T @ camera.translation * (1, 1, 0)
    assert hips @ (towards / np.linalg.norm(towards)) > 0.99  # the right side faces the camera
    arm = directions("arm_swing", "right_shoulder", "right_elbow", 97)
    ahead = np.cross((0, 0, 1), -hips)
    angle = np.degrees(np.arctan2(arm @ -ahead, -arm[:, 2]))
    steps = np.abs(np.diff(angle))
    assert angle.min() < -45 and angle.max() > 65 and steps[2:45].std() < 0.1 * steps.mean()
    still = directions("arm_swing", "left_shoulder", "left_wrist", 20)
    assert np.ptp(still, axis=0).max() < 1e-9


def test_golf_and_pointing_face_their_camera():
    for name in ("golf", "pointing"):
        hips = directions(name, "right_hip", "left_hip", 2)[0]
        facing = np.degrees(np.arctan2(*np.cross(hips, (0, 0, 1))[:2] * (1, -1)))
        assert facing == pytest.approx(-15, abs=1)  # cam_2 stands 15 degrees to its right
    left, right = (
        directions("golf", f"{side}_shoulder", f"{side}_wrist") for side in ("left", "right")
    )
    assert (
        (left @ (0, 0, 1)).max() > 0.3
        and (right @ (0, 0, 1)).max() > 0.3
        and (left @ (0, 0, 1)).min() < -0.7
    )
    pointing = directions("pointing", "right_shoulder", "right_wrist")
    assert (
        max((pointing @ axis).max() for axis in np.eye(3)[2:]) > 0.4
        and (pointing[:, 1].min()) < -0.9
    )
    assert (
        np.degrees(
            np.arccos(
                np.clip(directions("pointing", "left_shoulder", "left_wrist") @ (0, 0, -1), -1, 1)
            )
        ).max()
        < 25
    )


def test_there_and_back_ends_where_it_began():
    played = performances()["there_and_back"]
    end_s = played.keys[-1, 0]
    (first, first_bones), (last, last_bones) = played.pose_at(0.0), played.pose_at(end_s - 1e-9)
    np.testing.assert_allclose(last, first, atol=1e-6)
    assert first_bones.keys() == last_bones.keys()
    for name, rotation in first_bones.items():
        assert (rotation.inv() * last_bones[name]).magnitude() < 1e-5
    moved = [played.pose_at(t)[0] for t in np.arange(0, end_s, 0.05)]
    assert np.linalg.norm(np.diff(moved, axis=0), axis=1).max() < 0.05  # 1 m/s
