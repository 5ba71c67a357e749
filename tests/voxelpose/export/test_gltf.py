"""GLB as a second reader sees it; the mesh as trimesh does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from silhouette_core.motion import kinematics
from tests.clips import waving
from tests.voxelpose.export.glb_reader import Glb
from voxelpose.export.gltf import write_glb


def world_from_gltf(points: np.ndarray) -> np.ndarray:
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


@pytest.fixture
def written(tmp_path):
    def write(motion) -> Path:
        write_glb(motion, tmp_path / "motion.glb")
        return tmp_path / "motion.glb"

    return write


def test_every_joint_and_the_skin_are_where_our_kinematics_puts_them(written):
    motion = waving()
    file = Glb(written(motion))
    rotation, origin = motion.parts()
    for row in range(len(motion)):
        world = file.world_matrices(row)
        joints = world_from_gltf(np.array([world[name][:3, 3] for name in motion.model.names]))
        np.testing.assert_allclose(joints, origin[row], atol=2e-6)
        skin = kinematics.skin(motion.model, rotation[row], origin[row])
        np.testing.assert_allclose(world_from_gltf(file.skinned(row)), skin, atol=5e-6)


def test_left_hand_is_toward_x_of_a_body_that_faces_z(written):
    motion = waving(1)
    nodes = Glb(written(motion)).document["nodes"]
    rest = np.array([node.get("translation", (0, 0, 0)) for node in nodes])
    names = [node["name"] for node in nodes]
    assert rest[names.index("left_thigh"), 0] > 0.05 > -0.05 > rest[names.index("right_thigh"), 0]
    assert rest[names.index("left_toes"), 2] > 0.05


def test_each_of_several_people_is_moved_by_one_animation_on_one_clock(tmp_path):
    motions = [waving(5), waving(5, 1.6).select(np.arange(2, 5))]
    write_glb(motions, tmp_path / "motion.glb")
    file = Glb(tmp_path / "motion.glb")
    assert len(file.document["animations"]) == 1
    colours = [
        material["pbrMetallicRoughness"]["baseColorFactor"]
        for material in file.document["materials"]
    ]
    assert len(colours) == 2 and colours[0] != colours[1]
    for number, motion in enumerate(motions, 1):
        own = file.only(f"person_{number}")
        times_s, _ = own.channels()["pelvis", "rotation"]
        np.testing.assert_allclose(times_s, motion.time_s, atol=1e-6)
        rotation, origin = motion.parts()
        world = own.world_matrices(1)
        joints = world_from_gltf(np.array([world[name][:3, 3] for name in motion.model.names]))
        np.testing.assert_allclose(joints, origin[1], atol=2e-6)
        skin = kinematics.skin(motion.model, rotation[1], origin[1])
        np.testing.assert_allclose(world_from_gltf(own.skinned(1)), skin, atol=5e-6)
    assert len(trimesh.load(tmp_path / "motion.glb").geometry) == 2


def test_quaternions_are_unit_and_take_the_short_way(written):
    # Twice around: the sign of a canonical quaternion would jump.
    spun = np.radians(np.linspace(0, 700, 12)) / 2
    motion = replace(
        waving(12), root_quaternion=np.column_stack([np.cos(spun), np.zeros((12, 2)), np.sin(spun)])
    )
    channels = Glb(written(motion)).channels()
    turns = [values for (_, path), (_, values) in channels.items() if path == "rotation"]
    assert len(turns) == 27
    for values in turns:
        np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, atol=1e-6)
        assert ((values[1:] * values[:-1]).sum(axis=1) > 0).all()


def test_weights_sum_to_one_and_name_each_joint_once(written):
    file = Glb(written(waving(1)))
    shape = {
        name: file.array(k)
        for name, k in file.document["meshes"][0]["primitives"][0]["attributes"].items()
    }
    np.testing.assert_allclose(shape["WEIGHTS_0"].sum(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(shape["NORMAL"], axis=1), 1, atol=1e-5)
    for joints, weights in zip(shape["JOINTS_0"], shape["WEIGHTS_0"], strict=True):
        assert len(set(joints[weights > 0])) == (weights > 0).sum()
        assert (joints[weights == 0] == 0).all()


def test_lost_frames_have_no_key_and_time_begins_with_the_first_pose(written):
    motion = waving(7).select(np.array([1, 2, 4, 6]))
    file = Glb(written(motion))
    for times, _ in file.channels().values():
        np.testing.assert_allclose(times, np.array([0, 1, 3, 5]) / motion.fps, rtol=1e-6)
    assert file.document["extras"] == {
        "fps": 25.0,
        "first_frame": 1,
        "conditioning": "filter not recorded",
    }


def test_trimesh_reads_the_body_at_rest(written):
    motion = waving(1)
    scene = trimesh.load(written(motion))
    (mesh,) = scene.geometry.values()
    assert mesh.is_watertight
    assert mesh.volume > 0.04  # outward faces, metres
    np.testing.assert_allclose(
        np.sort(mesh.extents), np.sort(np.ptp(motion.model.vertices_m, axis=0)), atol=1e-5
    )
