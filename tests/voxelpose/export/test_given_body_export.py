"""Exports and pictures of a body that is no person's, in its own names."""

import csv
import shutil
from dataclasses import replace

import bvhio
import numpy as np
import pytest
from trimesh import creation

from calib.errors import InputError
from examples.bodies.example_motions import example_motion
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.rigid_parts import Box, Capsule, ClosedMesh, body_of_parts, with_part
from silhouette_core.body.rigs.bvh_rig import read_bvh_rig
from silhouette_core.body.rigs.gltf_rig import read_gltf
from silhouette_core.body.rigs.rig_dofs import ball_joint
from silhouette_core.motion.anatomical import anatomical_angles
from silhouette_core.motion.joint_files import column_names, read_joints
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.sources import ring
from tests.voxelpose.export.glb_reader import Glb
from voxelpose.export.bvh import write_bvh
from voxelpose.export.formats import export_motion
from voxelpose.export.gltf import write_glb
from voxelpose.export.opensim import write_mot
from voxelpose.export.tables import write_angles
from voxelpose.view.images.figure import FigurePainter, skeleton_bones, skeleton_joints

MOTION = example_motion("quadruped", 3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("export")
    files = {path.name for path in export_motion(MOTION, out)}
    assert "motion.mot" not in files and {"motion.bvh", "motion.trc", "motion.glb"} <= files
    return out


def test_a_person_with_a_tool_has_anatomical_angles(tmp_path):
    motion = example_motion("person_with_stick", 2)
    export_motion(motion, tmp_path, ("csv", "npz"))
    found = np.genfromtxt(tmp_path / "angles.csv", delimiter=",", names=True)
    angles = anatomical_angles(motion)
    assert {f"{name}_deg" for name in angles.names} <= set(found.dtype.names)
    np.testing.assert_allclose(
        found["right_elbow_flexion_deg"], angles["right_elbow_flexion"], atol=1e-3
    )
    with np.load(tmp_path / "motion.npz") as arrays:
        assert tuple(arrays["anatomical_names"]) == angles.names


def test_a_tool_that_turns_has_its_own_angles_beside_the_persons(tmp_path):
    held = example_motion("person_with_stick", 2)
    turns = (Dof("turn", (0.0, 0.0, 1.0), (-90.0, 90.0)),)
    at = tuple(held.model.joints_m[held.model.names.index("left_fingers")].tolist())
    shape = [Box((at[0], at[1] - 0.2, at[2]), (at[0] + 0.02, at[1], at[2] + 0.02))]
    model = with_part(held.model, "key", "left_hand", at, shape, None, turns)
    angles = np.column_stack([held.angles_rad, [0.1, 0.2]])
    write_angles(replace(held, model=model, angles_rad=angles), tmp_path / "angles.csv")
    with (tmp_path / "angles.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["key.turn_deg"]) for row in rows] == pytest.approx([5.730, 11.459])
    assert "left_elbow_flexion_deg" in rows[0] and "left_forearm.flexion_deg" not in rows[0]


def test_opensims_coordinates_are_refused(tmp_path):
    with pytest.raises(InputError, match="a person's measurements"):
        write_mot(MOTION, tmp_path / "motion.mot")


def test_its_skeleton_is_drawn_between_its_landmarks():
    model = MOTION.model
    rotation, origin = (array[0] for array in MOTION.parts())
    joints = skeleton_joints(model, rotation, origin)
    bones = skeleton_bones(model)
    assert joints.shape == (len(model.names) + len(model.landmarks_m), 3)
    assert len(bones) == len(model.tree.landmark_names) - 1
    ends = np.array([[start, end] for start, end, _ in bones])
    assert ends.min() >= len(model.names) and ends.max() < len(joints)
    camera = ring(1, (320, 240)).cameras[0]
    blank = np.full((240, 320, 3), 90, np.uint8)
    assert (FigurePainter(model, camera).paint(blank, rotation, origin) != 90).any()


def test_a_joint_turned_by_a_right_angle_is_written_without_a_warning(tmp_path, recwarn):
    """Two of BVH's axes then coincide."""
    lamp = example_motion("desk_lamp", 2)
    angles = np.zeros_like(lamp.angles_rad)
    angles[:, lamp.model.tree.dof_names.index("shade.pitch")] = np.pi / 2
    write_bvh(replace(lamp, angles_rad=angles), tmp_path / "motion.bvh")
    assert not [w for w in recwarn if "Gimbal" in str(w.message)]
    root = bvhio.readAsHierarchy(str(tmp_path / "motion.bvh")).loadPose(1)
    bulb = next(joint for joint, _, _ in root.layout() if joint.Name == "shade")
    assert np.isfinite(np.array(bulb.PositionWorld)).all()


def skeleton_of(model) -> dict:
    """Name of each part -> its parent's and where its joint is at rest from the root, 0.1 mm."""
    names, joints = model.names, 1e4 * (model.joints_m - model.joints_m[0])
    above = ["" if parent < 0 else names[parent] for parent in model.tree.parents]
    places = [tuple(joint) for joint in (joints.round() + 0.0).tolist()]
    return dict(zip(names, zip(above, places, strict=True), strict=True))


def test_glb_places_every_joint_and_is_read_as_the_same_body(folder):
    glb, (_, origin) = Glb(folder / "motion.glb"), MOTION.parts()
    for key in range(3):
        placed = glb.world_matrices(key)
        for part, name in enumerate(MOTION.model.names):
            x, y, z = placed[name][:3, 3]
            np.testing.assert_allclose([x, -z, y], origin[key, part], atol=1e-5)
    again = read_gltf(folder / "motion.glb")
    assert skeleton_of(again) == skeleton_of(MOTION.model)
    np.testing.assert_allclose(np.ptp(again.vertices_m, 0), np.ptp(MOTION.model.vertices_m, 0))


def test_bvh_is_read_as_the_same_skeleton(folder, tmp_path):
    shutil.copy(folder / "motion.bvh", tmp_path / "dog.bvh")
    (tmp_path / "dog.rig.toml").write_text('unit = "cm"\n')
    again = read_bvh_rig(tmp_path / "dog.bvh")
    assert skeleton_of(again) == skeleton_of(MOTION.model)


def test_npz_and_the_wide_table_hold_it_all(folder):
    with np.load(folder / "motion.npz") as arrays:
        assert tuple(arrays["part_names"]) == MOTION.model.names
        assert tuple(arrays["angle_names"]) == MOTION.model.tree.dof_names
        assert "anatomical_deg" not in arrays
        np.testing.assert_array_equal(arrays["angles_rad"], MOTION.angles_rad)
        np.testing.assert_allclose(arrays["landmarks"], MOTION.landmarks())
        np.testing.assert_allclose(arrays["part_origin"], MOTION.parts()[1])
    header, *rows = (folder / "joints_wide.csv").read_text().splitlines()
    names = [f"{joint}_{axis}_m" for joint in MOTION.model.tree.landmark_names for axis in "xyz"]
    assert header.split(",") == ["frame", "time_s", *names]
    found = np.array([row.split(",")[2:] for row in rows], float).reshape(3, -1, 3)
    np.testing.assert_allclose(found, MOTION.landmarks(), atol=1e-6)


def renamed(motion, names: dict[str, str]):
    tree = motion.model.tree
    new = tuple(names.get(name, name) for name in tree.names)
    marks = tuple(names.get(name, name) for name in tree.landmark_names)
    tree = replace(tree, names=new, landmark_names=marks)
    return replace(motion, model=replace(motion.model, tree=tree))


def test_names_that_a_format_cannot_hold_stay_apart(tmp_path):
    names = {"head": "頭", "neck": "首", "left_fore_paw": "paw, left", "tail": 'the "tail"'}
    odd = renamed(MOTION, names)
    export_motion(odd, tmp_path)
    root = bvhio.readAsHierarchy(str(tmp_path / "motion.bvh")).loadPose(0)
    words = [joint.Name for joint, _, _ in root.layout()]
    assert len(set(words)) == len(words) == len(odd.model.names) and {"_", "__2"} <= {*words}
    header = (tmp_path / "motion.trc").read_text().splitlines()[3].split("\t")
    labels = [name for name in header[2:] if name]
    assert len(set(labels)) == len(labels) == len(odd.model.tree.landmark_names)
    for table in ("joints.csv", "joints_wide.csv", "angles.csv"):
        with (tmp_path / table).open(newline="") as file:
            header, *rows = csv.reader(file)
        assert {len(row) for row in rows} == {len(header)}
    words = column_names(odd.model.tree.landmark_names)
    found = read_joints(tmp_path / "joints.csv", 3, names=words)
    np.testing.assert_allclose(found, odd.landmarks(), atol=1e-5)


def test_a_body_of_many_vertices_keeps_its_faces_in_glb(tmp_path):
    """Beyond 65535 vertices an index needs four bytes."""
    ball = creation.icosphere(7, 0.5)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    tree = KinematicTree.from_parts((("ball", "", ()),))
    model = body_of_parts(tree, np.zeros((1, 3)), [[ClosedMesh(points, faces)]])
    assert len(model.vertices_m) > 65535
    still = np.array([[1.0, 0, 0, 0]])
    write_glb(Motion(15.0, model, np.zeros((1, 3)), still, np.zeros((1, 0))), tmp_path / "a.glb")
    glb = Glb(tmp_path / "a.glb")
    shape = glb.document["meshes"][0]["primitives"][0]
    np.testing.assert_array_equal(glb.array(shape["indices"]).reshape(-1, 3), model.faces)


def test_an_object_without_joints_is_exported_and_read_again(tmp_path):
    tree = KinematicTree.from_parts((("case", "", ()),))
    model = body_of_parts(tree, np.zeros((1, 3)), [[Box((-0.3, -0.2, -0.1), (0.3, 0.2, 0.1))]])
    still, root = np.tile([1.0, 0, 0, 0], (2, 1)), np.array([[0, 0, 0.5], [0.1, 0, 0.5]])
    motion = Motion(15.0, model, root, still, np.zeros((2, 0)))
    write_motion(motion, tmp_path / "case.safetensors")
    again = read_motion(tmp_path / "case.safetensors")
    assert again.angles_rad.shape == (2, 0) and again.model.names == ("case",)
    export_motion(again, tmp_path / "out")
    assert (tmp_path / "out" / "angles.csv").read_text().splitlines()[1] == "0,0.000000"
    found = read_joints(tmp_path / "out" / "joints.csv", 2, names=("case",))
    np.testing.assert_allclose(found[:, 0], root)


def test_a_body_of_many_joints_is_read_again(tmp_path):
    """As rigs of games have them: 160 bones with three turns each."""
    turns = ball_joint(30.0)
    parts = [("b0", "", ())] + [(f"b{k}", f"b{k - 1}", turns) for k in range(1, 160)]
    tree = KinematicTree.from_parts(parts)
    joints = np.column_stack([np.zeros((160, 2)), 0.01 * np.arange(160)])
    ends = joints + np.array([0, 0, 0.01])
    shapes = [
        [Capsule((0, 0, a[2]), (0, 0, b[2]), 0.02)] for a, b in zip(joints, ends, strict=True)
    ]
    model = body_of_parts(tree, joints, shapes)
    still = np.array([[1.0, 0, 0, 0]])
    motion = Motion(15.0, model, joints[:1], still, np.full((1, model.dof_count), 0.01))
    write_motion(motion, tmp_path / "long.safetensors")
    again = read_motion(tmp_path / "long.safetensors")
    np.testing.assert_array_equal(again.landmarks(), motion.landmarks())
    export_motion(again, tmp_path / "out")
    found = read_joints(tmp_path / "out" / "joints.csv", 1, names=model.names)
    np.testing.assert_allclose(found, motion.landmarks(), atol=1e-6)
