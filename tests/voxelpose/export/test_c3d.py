"""C3D as py-c3d reads it, which is not the library that wrote it."""

import warnings
from dataclasses import replace
from pathlib import Path

import c3d
import ezc3d
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from tests.clips import waving
from voxelpose.export.c3d import write_c3d
from voxelpose.export.skeleton import named_points


def read(path: Path) -> tuple[float, list[str], np.ndarray, str]:
    """Returns rate, labels, (F, K, 3) metres with NaN where the file says that a point was not
    seen, and the unit.
    """
    with path.open("rb") as file, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="No analog data")
        reader = c3d.Reader(file)
        points = np.array([points for _, points, _ in reader.read_frames()])
        unit = reader.get("POINT:UNITS").string_value.strip()
        positions = np.where(points[..., 3:4] < 0, np.nan, points[..., :3])
        labels = [label.strip() for label in reader.point_labels]
        return reader.point_rate, labels, positions / 1000, unit


def test_points_labels_rate_and_unit(tmp_path):
    motion = waving(fps=29.97)
    write_c3d(motion, tmp_path / "motion.c3d")
    rate, labels, points, unit = read(tmp_path / "motion.c3d")
    names, expected = named_points(motion)
    assert (tuple(labels), unit) == (names, "mm")
    assert rate == pytest.approx(motion.fps, rel=1e-6)
    np.testing.assert_allclose(points, expected, atol=1e-6)
    joints = points[:, [labels.index(name) for name in LANDMARK_NAMES]]
    np.testing.assert_allclose(joints, motion.landmarks(), atol=1e-6)


def test_lost_frames_are_not_seen(tmp_path):
    motion = waving(7)
    keep = np.array([1, 2, 4, 6])
    write_c3d(motion.select(keep), tmp_path / "motion.c3d")
    _, _, points, _ = read(tmp_path / "motion.c3d")
    assert len(points) == 6
    assert np.isnan(points[[2, 4]]).all()
    np.testing.assert_allclose(points[keep - 1], named_points(motion)[1][keep], atol=1e-6)


@pytest.mark.parametrize(("first", "header"), [(41, 42), (69_999, 1)])
def test_frames_keep_their_numbers(tmp_path, first, header):
    write_c3d(replace(waving(7), frames=np.arange(first, first + 7)), tmp_path / "motion.c3d")
    with (tmp_path / "motion.c3d").open("rb") as file, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="No analog data")
        reader = c3d.Reader(file)
        numbers = [
            reader.get(f"TRIAL:ACTUAL_{name}_FIELD").uint16_array @ [1, 1 << 16]
            for name in ("START", "END")
        ]
        assert reader.header.first_frame == header
    assert numbers == [first + 1, first + 7]  # counted from 1, as TRC does
    assert ezc3d.c3d(str(tmp_path / "motion.c3d"))["data"]["points"].shape[2] == 7


def test_more_frames_than_the_format_counts_are_refused(tmp_path):
    motion = replace(waving(2), frames=np.array([3, 65538]), time_s=np.array([0.0, 1.0]))
    with pytest.raises(InputError, match="spans 65536: leave c3d out"):
        write_c3d(motion, tmp_path / "motion.c3d")
    assert not (tmp_path / "motion.c3d").exists()
