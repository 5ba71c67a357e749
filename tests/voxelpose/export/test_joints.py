"""joints.csv as conventions.md has it."""

import csv

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import read_joints
from tests.clips import waving
from voxelpose.export.tables import write_joints


def test_one_row_per_frame_and_joint(tmp_path):
    motion = waving(4).select(np.array([0, 1, 3]))
    write_joints(motion, tmp_path / "joints.csv")
    with (tmp_path / "joints.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["frame", "time_s", "joint", "x_m", "y_m", "z_m", "confidence"]
    assert [int(row["frame"]) for row in rows] == [0] * 15 + [1] * 15 + [3] * 15
    assert [row["joint"] for row in rows[:15]] == list(LANDMARK_NAMES)
    read = np.array([[float(row[c]) for c in ("x_m", "y_m", "z_m")] for row in rows]).reshape(
        3, 15, 3
    )
    np.testing.assert_allclose(read, motion.landmarks(), atol=1e-6)
    assert float(rows[-1]["time_s"]) == 3 / motion.fps
    assert 0 < float(rows[0]["confidence"]) <= 1


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0,0.0,pelvis,1e308,0,0,1", "positions beyond 100 km"),
        ("0,0.0,pelvis,inf,0,0,1", "positions beyond 100 km"),
        ("x,0.0,pelvis,0,0,0,1", "line 2 cannot be read as frame,joint"),
        ("9" * 5000 + ",0.0,pelvis,0,0,0,1", "line 2 cannot be read as frame,joint"),
        ("0,0.0", "line 2 cannot be read as frame,joint"),
        ('"' + "0,0\n" * 100_000, "field larger than field limit"),
    ],
)
def test_damaged_rows_are_named(tmp_path, row, words):
    path = tmp_path / "joints.csv"
    path.write_text("frame,time_s,joint,x_m,y_m,z_m,confidence\n" + row + "\n")
    with pytest.raises(InputError, match=words) as error:
        read_joints(path, 3)
    assert len(str(error.value)) < 400
