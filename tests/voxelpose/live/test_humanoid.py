"""Rotations and positions of Unity's humanoid, against values derived by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import PART_NAMES
from tests.voxelpose.live.live_scenes import person, posed
from voxelpose.live.live_frame import PosedBody
from voxelpose.live.messages import BONE_NAMES, BONE_PARENTS, BONE_PARTS, humanoid_pose

HALF = np.sqrt(0.5)
T_POSE = {"left_upper_arm.abduction": 45.0, "right_upper_arm.abduction": 45.0}
IDENTITY = [0, 0, 0, 1]


def rotations(body: PosedBody) -> dict[str, np.ndarray]:
    return dict(zip(BONE_NAMES, humanoid_pose(body)[1], strict=True))


def assert_only(body: PosedBody, turned: dict[str, list[float]]) -> None:
    """Only the named bones have a rotation, and theirs is this one."""
    for name, rotation in rotations(body).items():
        np.testing.assert_allclose(
            rotation, turned.get(name, IDENTITY), atol=1e-9, err_msg=f"bone {name}"
        )


def world(body: PosedBody) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rotation and position of every bone in Unity's world, by adding up the local ones."""
    (positions_m, rotations), found = humanoid_pose(body), {}
    for k, name in enumerate(BONE_NAMES):
        turn, at = Rotation.from_quat(rotations[k]).as_matrix(), positions_m[k]
        if BONE_PARENTS[k] >= 0:
            above, base = found[BONE_NAMES[BONE_PARENTS[k]]]
            turn, at = above @ turn, base + above @ at
        found[name] = turn, at
    return found


def test_names_are_unitys():
    assert len(BONE_NAMES) == len(set(BONE_NAMES)) == len(BONE_PARTS) == 22
    assert {"Hips", "UpperChest", "LeftShoulder", "RightLowerArm", "LeftToes"} <= set(BONE_NAMES)
    assert all(parent < k for k, parent in enumerate(BONE_PARENTS))
    assert PART_NAMES[BONE_PARTS[BONE_NAMES.index("RightFoot")]] == "right_foot"


def test_no_bone_is_turned_in_the_t_pose():
    assert_only(posed(T_POSE), {})


def test_arms_lie_along_x_in_the_t_pose_and_left_is_left():
    joints = {name: at for name, (_, at) in world(posed(T_POSE)).items()}
    for side, sign in (("Left", -1), ("Right", 1)):
        upper = joints[side + "LowerArm"] - joints[side + "UpperArm"]
        lower = joints[side + "Hand"] - joints[side + "LowerArm"]
        for bone in (upper, lower):
            np.testing.assert_allclose(bone / np.linalg.norm(bone), [sign, 0, 0], atol=2e-3)
        assert sign * joints[side + "Foot"][0] > 0.05
        toes = joints[side + "Toes"] - joints[side + "Foot"]
        assert toes[2] > 0.8 * np.linalg.norm(toes)  # the humanoid faces +z
    assert joints["Head"][1] > 1.4 > joints["Hips"][1] > 0.8


def test_the_rest_pose_lowers_both_arms():
    # Left arm: from -x halfway to -y, in Unity by +45 degrees about z; right by -45.
    sine, cosine = np.sin(np.pi / 8), np.cos(np.pi / 8)
    turned = {"LeftUpperArm": [0, 0, sine, cosine], "RightUpperArm": [0, 0, -sine, cosine]}
    assert_only(posed(), turned)


def test_a_forearm_bent_forward():
    # Left forearm: from -x to +z, by +90 degrees about y. Right: from +x to +z, by -90.
    body = posed({**T_POSE, "left_forearm.flexion": 90.0})
    assert_only(body, {"LeftLowerArm": [0, HALF, 0, HALF]})
    body = posed({**T_POSE, "right_forearm.flexion": 90.0})
    assert_only(body, {"RightLowerArm": [0, -HALF, 0, HALF]})


def test_a_raised_left_forearm():
    # From -x to +y, in Unity by -90 degrees about z; in the world from +x to +z, by -90 about y.
    t_pose = posed(T_POSE)
    turn = Rotation.from_rotvec([0, -np.pi / 2, 0]).as_matrix()
    moved = t_pose.part_rotation.copy()
    for name in ("forearm", "hand"):
        part = PART_NAMES.index(f"left_{name}")
        moved[part] = turn @ moved[part]
    raised = PosedBody(
        t_pose.model, t_pose.pose, moved, t_pose.part_origin_m, t_pose.joints_m,
        t_pose.joint_confidence, 1.0,
    )  # fmt: skip
    assert_only(raised, {"LeftLowerArm": [0, 0, -HALF, HALF]})


def test_heading_and_place():
    # A person who turns left by 90 degrees faces the world's +x: in Unity from +z to -x, by -90
    # about y.
    turn = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()
    np.testing.assert_allclose(turn @ [0, -1, 0], [1, 0, 0], atol=1e-12)
    body = posed(T_POSE, turn, root_m=(1.0, 2.0, 0.9))
    assert_only(body, {"Hips": [0, -HALF, 0, HALF]})
    np.testing.assert_allclose(humanoid_pose(body)[0][0], [-1.0, 0.9, -2.0])


@pytest.mark.parametrize("stature_m", [1.5, 1.9])
def test_a_humanoid_of_these_lengths_stands_where_the_body_stands(stature_m):
    generator = np.random.default_rng(7)
    degrees = {name: generator.uniform(-40, 40) for name in person().tree.dof_names}
    turn = Rotation.random(rng=generator).as_matrix()
    body = posed(degrees, turn, (0.3, -0.2, 1.1), person(stature_m))
    found = world(body)
    for name, part in zip(BONE_NAMES, BONE_PARTS, strict=True):
        x, y, z = body.part_origin_m[part]
        np.testing.assert_allclose(found[name][1], [-x, z, -y], atol=1e-9, err_msg=name)


def test_bones_without_an_arm_turn_as_their_parts_do():
    body = posed({"left_thigh.flexion": 30.0, "left_shin.flexion": 60.0})
    # Thigh forward, from -y to +z: in Unity by -30 degrees about x; the shin back by +60.
    angle = np.radians(15)
    expected = {
        "LeftUpperLeg": [-np.sin(angle), 0, 0, np.cos(angle)],
        "LeftLowerLeg": [0.5, 0, 0, np.cos(2 * angle)],
    }
    found = rotations(body)
    for name, rotation in expected.items():
        np.testing.assert_allclose(found[name], rotation, atol=1e-9)
