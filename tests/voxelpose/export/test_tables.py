"""CSV and NPZ read back with the standard library and NumPy."""

import csv
from pathlib import Path

import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import anatomical_angles
from tests.clips import turning, waving
from voxelpose.export.tables import write_angles, write_npz, write_wide_joints


@pytest.fixture
def motion():
    return waving(7).select(np.array([0, 1, 3, 6]))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_wide_joints(tmp_path, motion):
    write_wide_joints(motion, tmp_path / "joints_wide.csv")
    read = rows(tmp_path / "joints_wide.csv")
    assert [int(row["frame"]) for row in read] == [0, 1, 3, 6]
    assert float(read[2]["time_s"]) == pytest.approx(3 / 25)
    columns = [f"{name}_{axis}_m" for name in LANDMARK_NAMES for axis in "xyz"]
    joints = np.array([[float(row[name]) for name in columns] for row in read])
    np.testing.assert_allclose(joints, motion.landmarks().reshape(4, -1), atol=1e-6)
    right, head, left = (f"{name}_z_m" for name in ("right_wrist", "head_top", "left_wrist"))
    assert float(read[-1][right]) > float(read[-1][head]) > float(read[-1][left])


def test_angles(tmp_path, motion):
    write_angles(motion, tmp_path / "angles.csv")
    read, angles = rows(tmp_path / "angles.csv"), anatomical_angles(motion)
    assert list(read[0]) == ["frame", "time_s", *(f"{name}_deg" for name in angles.names)]
    table = np.array([[float(row[f"{name}_deg"]) for name in angles.names] for row in read])
    np.testing.assert_allclose(table, angles.degrees, atol=1e-3)
    left_deg, right_deg = (float(read[-1][f"{s}_knee_flexion_deg"]) for s in ("left", "right"))
    assert left_deg > 80 > 20 > right_deg


def test_somebody_who_turns_twice_leaves_no_jumps(tmp_path):
    write_angles(turning(), tmp_path / "angles.csv")
    write_npz(turning(), tmp_path / "motion.npz")
    turned = [float(row["pelvis_rotation_deg"]) for row in rows(tmp_path / "angles.csv")]
    assert np.abs(np.diff(turned)).max() < 180 < 500 < np.ptp(turned)
    with np.load(tmp_path / "motion.npz", allow_pickle=False) as file:
        assert np.abs(np.diff(file["anatomical_deg"], axis=0)).max() <= 180
        quaternions = file["root_quaternion"]
    assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) > 0).all()


def test_npz_needs_no_pickle_and_its_rotations_make_its_joints(tmp_path, motion):
    write_npz(motion, tmp_path / "motion.npz")
    with np.load(tmp_path / "motion.npz", allow_pickle=False) as file:
        read = {name: file[name] for name in file.files}
    names, parents = read["part_names"].tolist(), read["parents"]
    assert read["frames"].tolist() == [0, 1, 3, 6]
    assert float(read["fps"]) == motion.fps
    placed = np.empty_like(read["part_origin"])
    for part, parent in enumerate(parents):
        offset = read["rest_joints"][part] - read["rest_joints"][parent]
        above = read["part_rotation"][:, parent] @ offset
        placed[:, part] = read["root_m"] if parent < 0 else placed[:, parent] + above
    np.testing.assert_allclose(placed, read["part_origin"], atol=1e-9)
    np.testing.assert_allclose(placed, motion.parts()[1], atol=1e-9)
    assert placed[-1, names.index("right_hand"), 2] > placed[-1, names.index("left_hand"), 2] + 0.5
    assert read["angles_rad"].shape == (4, len(read["angle_names"]))
    assert read["anatomical_deg"].shape == (4, len(read["anatomical_names"]))
    assert read["landmarks"].shape == (4, len(read["landmark_names"]), 3)
