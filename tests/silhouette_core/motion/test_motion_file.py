"""A motion comes back from its file as it was."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.upright import UprightFrame
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.clips import waving


def test_round_trip(tmp_path):
    clip = waving().in_world(UprightFrame.from_up([0.1, 0.9, -0.3], 0.8))
    write_motion(clip, tmp_path / "motion.safetensors")
    read = read_motion(tmp_path / "motion.safetensors")
    assert read.fps == clip.fps
    assert read.floor_m == clip.floor_m
    np.testing.assert_array_equal(read.up, clip.up)
    np.testing.assert_array_equal(read.angles_rad, clip.angles_rad)
    np.testing.assert_array_equal(read.landmarks(), clip.landmarks())
    np.testing.assert_array_equal(read.model.vertices_m, clip.model.vertices_m)
    assert read.quality.keys() == clip.quality.keys()


def test_equal_motions_make_equal_files(tmp_path):
    for name in ("a", "b", "c", "d"):
        write_motion(waving(), tmp_path / name)
    assert len({(tmp_path / name).read_bytes() for name in ("a", "b", "c", "d")}) == 1


def test_body_keeps_its_shape(tmp_path):
    clip = waving()
    shaped = clip.model.reshaped(np.linspace(-0.05, 0.05, len(clip.model.shape)))
    write_motion(
        type(clip)(clip.fps, shaped, clip.root_m, clip.root_quaternion, clip.angles_rad),
        tmp_path / "m.safetensors",
    )
    np.testing.assert_allclose(
        read_motion(tmp_path / "m.safetensors").model.vertices_m, shaped.vertices_m, atol=1e-12
    )


@pytest.mark.parametrize("content", [None, b"", b"frame,time_s\n"])
def test_what_is_no_motion_is_said_in_one_line(tmp_path, content):
    path = tmp_path / "motion.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"motion\.safetensors cannot be read as a motion"):
        read_motion(path)
