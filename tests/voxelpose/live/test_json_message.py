"""JSON lines, against the schema of docs/live.md."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.motion import kinematics
from tests.voxelpose.live.live_scenes import bare_frame, posed
from voxelpose.live.messages import json_message


def test_a_receiver_can_rebuild_the_pose():
    turn = Rotation.from_rotvec([0.1, -0.2, 0.7]).as_matrix()
    body = posed({"left_forearm.flexion": 50.0, "neck.rotation": 20.0}, turn, (1, 2, 0.9))
    line = json_message(bare_frame(7, body), sent_unix_s=1.75e9 + 0.5)
    assert line.endswith("\n") and line.count("\n") == 1
    message = json.loads(line)
    assert (message["format"], message["version"]) == ("voxelpose live", 1)
    assert (message["number"], message["time_s"], message["note"]) == (7, 7 / 25, "")
    assert message["sent_unix_s"] - message["captured_unix_s"] == pytest.approx(0.22)
    found = message["body"]
    assert found["confidence"] == 0.875
    assert list(found["joints"]) == list(LANDMARK_NAMES)
    for k, name in enumerate(LANDMARK_NAMES):
        assert found["joints"][name]["position_m"] == pytest.approx(body.joints_m[k], abs=1e-5)
    assert found["joints"]["right_wrist"]["confidence"] == 1.0
    assert found["root"]["position_m"] == [1, 2, 0.9]
    turns = {
        name: kinematics.rotation_matrices(np.array(quaternion))
        for name, quaternion in found["local_rotations_wxyz"].items()
    }
    whole: dict[str, np.ndarray] = {}
    for part, name in enumerate(PART_NAMES):
        parent = body.model.tree.parents[part]
        above = whole[PART_NAMES[parent]] if parent >= 0 else np.eye(3)
        whole[name] = above @ turns[name]
        np.testing.assert_allclose(whole[name], body.part_rotation[part], atol=1e-4)
    np.testing.assert_allclose(
        kinematics.rotation_matrices(np.array(found["root"]["rotation_wxyz"])), turn, atol=1e-4
    )
    assert found["angles_rad"]["left_forearm.flexion"] == pytest.approx(np.radians(50), abs=1e-5)


def test_what_is_unknown_is_null():
    frame = replace(
        bare_frame(), captured_unix_s=float("nan"), note="zwei Personen: größte gewählt"
    )
    message = json.loads(json_message(frame, 5.0))
    assert message["captured_unix_s"] is None and message["body"] is None
    assert message["note"] == frame.note
    body = posed()
    lost = body.joints_m.copy()
    lost[3] = np.nan
    message = json.loads(json_message(bare_frame(body=replace(body, joints_m=lost)), 5.0))
    assert message["body"]["joints"]["left_ankle"]["position_m"] == [None, None, None]


def test_of_several_people_each_has_a_message_with_the_number():
    body = posed(root_m=(1, 2, 0.9))
    alone = json.loads(json_message(bare_frame(7, body), 5.0))
    frame = replace(bare_frame(7), people=(None, body))
    absent, there = (json.loads(json_message(frame, 5.0, person)) for person in (0, 1))
    assert (absent.pop("person"), there.pop("person")) == (1, 2)
    assert there == alone and absent == alone | {"body": None}
