"""The demo's recording: readable like any other, its truth consistent with what the cameras saw."""

import json

import cv2
import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.demo.choreography import pose_at
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.demo.recording import make_recording
from voxelpose.recording import Recording


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
        empty = cv2.VideoCapture(str(folder / "background" / f"{camera.name}.mp4")).read()[1].astype(int)
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
        vertices, joints = actor.pose(*pose_at(time))
        assert abs(vertices[:, 2].min()) < 1e-9
        lengths.append(
            [np.linalg.norm(joints["left_hip"] - joints["left_knee"]), np.linalg.norm(joints["right_elbow"] - joints["right_wrist"])]
        )
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], (13, 2)), atol=1e-9)


def test_same_seed_same_pictures(folder, tmp_path):
    again = make_recording(tmp_path, frames=1)
    first, second = (cv2.VideoCapture(str(f / "background" / "cam_2.mp4")).read()[1] for f in (folder, again))
    np.testing.assert_array_equal(first, second)


def test_mistakes_are_named(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="frames must be at least 1"):
        make_recording(tmp_path, frames=0)
    monkeypatch.setattr(cv2.VideoWriter, "isOpened", lambda self: False, raising=False)
    with pytest.raises(InputError, match=r"cam_1\.mp4 cannot be written"):
        make_recording(tmp_path, frames=1)
