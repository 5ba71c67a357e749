"""Exports and pictures of a body that is no person's, in its own names."""

import csv

import bvhio
import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import ring
from voxelpose.demo.example_motions import example_motion
from voxelpose.export.formats import export_motion
from voxelpose.export.joints import read_joints
from voxelpose.export.mot import write_mot
from voxelpose.view.images.figure import FigurePainter, skeleton_bones, skeleton_joints

MOTION = example_motion("quadruped", 3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("export")
    files = {path.name for path in export_motion(MOTION, out)}
    assert "motion.mot" not in files and {"motion.bvh", "motion.trc", "motion.glb"} <= files
    return out


def test_joints_have_the_bodys_own_names(folder):
    names = MOTION.model.tree.landmark_names
    found = read_joints(folder / "joints.csv", 3, names=names)
    np.testing.assert_allclose(found, MOTION.landmarks(), atol=1e-5)
    header = (folder / "joints_wide.csv").read_text().splitlines()[0]
    assert "nose_x_m" in header and "pelvis" not in header
    header = (folder / "motion.trc").read_text().splitlines()[3]
    assert "left_hind_paw" in header and "heel" not in header


def test_angles_are_those_of_its_own_joints(folder):
    with (folder / "angles.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    column = MOTION.model.dof_names.index("left_fore_lower.bend")
    found = [float(row["left_fore_lower.bend_deg"]) for row in rows]
    np.testing.assert_allclose(found, np.degrees(MOTION.angles_rad[:, column]), atol=1e-3)


def test_bvh_places_every_joint(folder):
    root = bvhio.readAsHierarchy(str(folder / "motion.bvh")).loadPose(2)
    placed = {joint.Name: joint.PositionWorld for joint, _, _ in root.layout()}
    for part, name in enumerate(MOTION.model.names):
        x, y, z = placed[name]
        np.testing.assert_allclose([x, -z, y], 100 * MOTION.parts()[1][2, part], atol=1e-3)


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
