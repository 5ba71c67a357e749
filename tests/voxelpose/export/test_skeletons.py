"""Motions on the skeletons of other programs, bone by bone, as second readers see them."""

from dataclasses import replace
from typing import get_args

import bvhio
import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from silhouette_core.motion.kinematics import skin
from silhouette_core.motion.motion import Motion
from silhouette_core.setting_types import SkeletonName
from tests.clips import waving
from tests.voxelpose.export.glb_reader import Glb
from voxelpose.export.bvh import write_bvh
from voxelpose.export.excerpt import Excerpt
from voxelpose.export.formats import export_motion
from voxelpose.export.gltf import write_glb
from voxelpose.export.rigged import rigged

SKELETONS = get_args(SkeletonName)
Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
PARTS = (
    "pelvis lumbar thorax upper_thorax neck head left_clavicle left_upper_arm left_forearm"
    " left_hand left_thigh left_shin left_foot left_toes"
).split()
# Names of those parts, and how the right ones differ.
NAMES = {
    "mixamo": (
        "Hips Spine Spine1 Spine2 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand LeftUpLeg"
        " LeftLeg LeftFoot LeftToeBase",
        ("Left", "Right"),
    ),
    "rigify": (
        "spine spine.001 spine.002 spine.003 spine.004 spine.006 shoulder.L upper_arm.L forearm.L"
        " hand.L thigh.L shin.L foot.L toe.L",
        (".L", ".R"),
    ),
    "unreal": (
        "pelvis spine_01 spine_02 spine_03 neck_01 head clavicle_l upperarm_l lowerarm_l hand_l"
        " thigh_l calf_l foot_l ball_l",
        ("_l", "_r"),
    ),
    "unity": (
        "Hips Spine Chest UpperChest Neck Head LeftShoulder LeftUpperArm LeftLowerArm LeftHand"
        " LeftUpperLeg LeftLowerLeg LeftFoot LeftToes",
        ("Left", "Right"),
    ),
    "vrm": (
        "hips spine chest upperChest neck head leftShoulder leftUpperArm leftLowerArm leftHand"
        " leftUpperLeg leftLowerLeg leftFoot leftToes",
        ("left", "right"),
    ),
}


def parts_of(skeleton: str, motion: Motion) -> dict[str, int]:
    """Our parts by the names of the bones that they are."""
    parts = motion.model.names
    if skeleton == "voxelpose":
        return {name: part for part, name in enumerate(parts)}
    words, (left, right) = NAMES[skeleton]
    before = "mixamorig:" if skeleton == "mixamo" else ""
    names = {before + name: part for name, part in zip(words.split(), PARTS, strict=True)}
    names |= {
        name.replace(left, right): part.replace("left", "right")
        for name, part in names.items()
        if part.startswith("left_")
    }
    return {name: parts.index(part) for name, part in names.items()}


@pytest.fixture(scope="module")
def motion() -> Motion:
    """One in which parts move that most skeletons do not have, too."""
    clip = waving(4)
    angles = clip.angles_rad.copy()
    angles[:, clip.model.tree.dof_names.index("abdomen.flexion")] = np.linspace(0, 0.2, 4)
    return replace(clip, angles_rad=angles)


def assert_as_ours(place, turn, motion: Motion, skeleton: str) -> None:
    """Joints are where ours are, and bones turn from frame to frame as our parts do."""
    rotation, origin = motion.parts()
    for name, part in parts_of(skeleton, motion).items():
        for row in range(len(motion)):
            where = f"{name} in frame {row}"
            np.testing.assert_allclose(
                place(name, row), Y_UP @ origin[row, part], atol=1e-5, err_msg=where
            )
            turned = rotation[row, part] @ rotation[0, part].T
            np.testing.assert_allclose(
                turn(name, row) @ turn(name, 0).T, Y_UP @ turned @ Y_UP.T, atol=1e-5, err_msg=where
            )


@pytest.mark.parametrize("skeleton", SKELETONS)
def test_every_bone_of_bvh_is_where_our_part_is(tmp_path, motion, skeleton):
    write_bvh(rigged(motion, skeleton), tmp_path / "motion.bvh")
    root, poses = bvhio.readAsHierarchy(str(tmp_path / "motion.bvh")), []
    for row in range(len(motion)):
        root.loadPose(row)
        poses.append({joint.Name: joint.SpaceWorld for joint, _, _ in root.layout()})
    matrices = [{n: np.array(space.to_list()).T for n, space in pose.items()} for pose in poses]
    extra = {"root"} if skeleton == "unreal" else set()
    assert matrices[0].keys() == parts_of(skeleton, motion).keys() | extra

    def place(name, row):
        return matrices[row][name][:3, 3] / 100

    assert_as_ours(place, lambda name, row: matrices[row][name][:3, :3], motion, skeleton)


@pytest.mark.parametrize("skeleton", SKELETONS)
def test_every_bone_of_glb_is_where_our_part_is(tmp_path, motion, skeleton):
    write_glb(rigged(motion, skeleton), tmp_path / "motion.glb")
    file = Glb(tmp_path / "motion.glb")
    worlds = [file.world_matrices(row) for row in range(len(motion))]

    def place(name, row):
        return worlds[row][name][:3, 3]

    assert_as_ours(place, lambda name, row: worlds[row][name][:3, :3], motion, skeleton)
    joints = file.document["skins"][0]["joints"]
    assert len(joints) == len(parts_of(skeleton, motion)) + (skeleton == "unreal")
    moved = {node for node, path in file.channels() if path == "translation"}
    assert ("root" in moved) == (skeleton == "unreal")


T_POSE = {"upper_arm": (1, 0, 0), "forearm": (1, 0, 0), "thigh": (0, -1, 0), "shin": (0, -1, 0)}
RIGIFY = {"upper_arm": (0.856, -0.47, -0.214), "forearm": (0.826, -0.544, 0.15)}
UNREAL = {"upper_arm": (0.746, -0.666, -0.017), "thigh": (0.115, -0.993, -0.005)}
NEXT = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shin", "shin": "foot"}


@pytest.mark.parametrize(
    ("skeleton", "directions", "axis"),
    [
        ("mixamo", T_POSE, (1, 1, 1)),
        ("unity", T_POSE, None),
        ("vrm", T_POSE, None),
        ("rigify", RIGIFY, (1, 1, 1)),
        ("unreal", UNREAL, (0, 1, -1)),
    ],
)
def test_rest_pose_and_axes_are_the_other_program_s(tmp_path, motion, skeleton, directions, axis):
    """`axis`: which one of the bone points to its end, its sign in the left arm and leg."""
    write_glb(rigged(motion, skeleton), tmp_path / "motion.glb")
    scene = trimesh.load(tmp_path / "motion.glb")
    bones = {part: name for name, part in parts_of(skeleton, motion).items()}
    parts = motion.model.names

    def rest(side: str, limb: str) -> np.ndarray:
        return scene.graph.get(bones[parts.index(f"{side}_{limb}")])[0]

    for side, mirror in (("left", 1), ("right", -1)):
        for limb, direction in directions.items():
            along = rest(side, NEXT[limb])[:3, 3] - rest(side, limb)[:3, 3]
            along /= np.linalg.norm(along)
            expected = np.array(direction) * (mirror, 1, 1) / np.linalg.norm(direction)
            np.testing.assert_allclose(along, expected, atol=2e-3)
            frame = rest(side, limb)[:3, :3]
            np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-6)
            assert np.linalg.det(frame) > 0
            if axis is None:
                np.testing.assert_allclose(frame, np.eye(3), atol=1e-6)
                continue
            column, arm, leg = axis
            sign = (arm if "arm" in limb else leg) * (mirror if skeleton == "unreal" else 1)
            np.testing.assert_allclose(sign * frame[:, column], expected, atol=3e-3)
    (mesh,) = scene.geometry.values()
    assert mesh.bounds[0, 1] == pytest.approx(0, abs=1e-6)
    assert mesh.is_watertight


@pytest.mark.parametrize("skeleton", SKELETONS)
def test_the_skin_is_ours_in_our_rest_pose_and_near_it_elsewhere(tmp_path, motion, skeleton):
    angles = motion.angles_rad * np.array([0, 1, 1, 1])[:, None]
    clip = replace(motion, angles_rad=angles)
    write_glb(rigged(clip, skeleton), tmp_path / "motion.glb")
    file, (rotation, origin) = Glb(tmp_path / "motion.glb"), clip.parts()
    for row, (most_m, median_m) in {0: (1e-5, 1e-5), 3: (0.03, 0.001)}.items():
        expected = skin(clip.model, rotation[row], origin[row]) @ Y_UP.T
        off = np.linalg.norm(file.skinned(row) - expected, axis=1)
        assert off.max() < most_m and np.median(off) < median_m, (row, off.max(), np.median(off))


def test_a_vrm_names_the_bones_of_its_humanoid(tmp_path, motion):
    export_motion(motion, tmp_path, ["glb"], excerpt=Excerpt(skeleton="vrm"))
    document = Glb(tmp_path / "motion.glb").document
    assert document["extensionsUsed"] == ["VRMC_vrm"]
    vrm = document["extensions"]["VRMC_vrm"]
    assert vrm["specVersion"] == "1.0" and vrm["meta"]["authors"]
    bones = vrm["humanoid"]["humanBones"]
    assert bones.keys() == parts_of("vrm", motion).keys()
    for name, bone in bones.items():
        assert document["nodes"][bone["node"]]["name"] == name
    with pytest.raises(InputError, match="a VRM holds one person"):
        export_motion([motion, motion], tmp_path / "2", ["glb"], excerpt=Excerpt(skeleton="vrm"))


def test_the_way_through_the_room_is_unreal_s_root_s(tmp_path, motion):
    write_glb(rigged(motion, "unreal"), tmp_path / "motion.glb")
    channels = Glb(tmp_path / "motion.glb").channels()
    place = np.array([0, 0, 0]) + channels["root", "translation"][1]
    expected = motion.root_m @ Y_UP.T * (1, 0, 1)
    np.testing.assert_allclose(place, expected, atol=1e-6)
