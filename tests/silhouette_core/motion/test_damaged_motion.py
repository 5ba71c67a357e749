"""A motion file whose numbers are no motion's is refused in one line."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load, save

from calib.errors import InputError
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.clips import waving


def changed(path: Path, arrays: dict | None = None, about: dict | None = None) -> Path:
    """The motion of a few frames with other arrays and metadata; None leaves one out."""
    write_motion(waving(), path)
    data = path.read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    metadata = json.loads(data[8 : 8 + length])["__metadata__"] | (about or {})
    every = load(data) | (arrays or {})
    kept = {name: np.ascontiguousarray(array) for name, array in every.items() if array is not None}
    path.write_bytes(save(kept, {key: text for key, text in metadata.items() if text is not None}))
    return path


def refusal(path: Path) -> str:
    with pytest.raises(InputError, match=r"m\.safetensors is damaged .*: fit again") as error:
        read_motion(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("root_m", np.full((6, 3), 1e300)),
        ("root_m", np.full((6, 3), np.nan)),
        ("root_m", np.zeros((6, 3), np.float32)),
        ("root_m", np.zeros((6, 30))),
        ("root_m", np.zeros(())),
        ("root_m", None),
        ("root_quaternion", np.zeros((6, 4))),
        ("angles_rad", np.full((6, 54), 1e6)),
        ("angles_rad", np.zeros((6, 5))),
        ("frames", np.arange(6)[::-1]),
        ("frames", np.array([0, 1, 2, 3, 4, 2**40])),
        ("frames", np.array([0, 1, 2, 3, 4, 1_000_000])),
        ("frames", np.arange(-3, 3)),
        ("time_s", -np.arange(6.0)),
        ("time_s", np.full(6, np.inf)),
        ("up", np.array([0, 0, 7.0])),
        ("body_shape", np.full(len(SHAPE_AXES), -3.0)),
        ("body_shape", np.zeros(3)),
        ("filled", np.ones(6)),
        ("filled", np.ones(5, bool)),
        ("quality.part_overlap", np.ones((6, 3))),
        ("quality.unexplained", np.ones((6, 2))),
        ("quality.other", np.ones((6, 2, 2))),
        ("quality.other", np.ones((3,))),
        ("quality.other", np.full(6, 1e300)),
    ],
)
def test_the_array_is_named(tmp_path, name, array):
    line = refusal(changed(tmp_path / "m.safetensors", {name: array}))
    assert name.removeprefix("quality.") in line or "poses" in line or "time_s" in line


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"fps": "nan"}, "fps is nan"),
        ({"fps": "0"}, "fps is 0"),
        ({"fps": "x"}, "could not convert"),
        ({"fps": None}, "no entry 'fps'"),
        ({"stature_m": "9"}, "stature 9.0 m is not a person's"),
        ({"sex": "x"}, "sex 'x' is not known"),
        ({"floor_m": "1e308"}, "floor_m is 1e+308"),
        ({"angles": "[" * 5000}, "damaged"),
        ({"angles": "{}"}, "its angles are no list"),
        ({"conditioning": "3"}, "damaged"),
        ({"conditioning": '{"filter": "x"}'}, "enum value 'x'"),
        ({"conditioning": '{"cutoff_hz": "x"}'}, "Expected `float`"),
    ],
)
def test_metadata_are_checked(tmp_path, about, words):
    assert words in refusal(changed(tmp_path / "m.safetensors", about=about))


@pytest.mark.parametrize(
    ("shape", "words"),
    [((5, 3), "root_quaternion must be"), ((), "damaged"), ((6, 2), "root_m must be")],
)
def test_unfiltered_poses_are_checked(tmp_path, shape, words):
    motion = waving()
    arrays = {
        "unfiltered.root_m": np.zeros(shape),
        "unfiltered.root_quaternion": motion.root_quaternion,
        "unfiltered.angles_rad": motion.angles_rad,
    }
    assert words in refusal(changed(tmp_path / "m.safetensors", arrays))
    arrays["unfiltered.root_m"] = np.full((6, 3), 1e300)
    assert "root_m holds numbers beyond" in refusal(changed(tmp_path / "m.safetensors", arrays))
    del arrays["unfiltered.angles_rad"]
    assert "unfiltered.angles_rad" in refusal(changed(tmp_path / "m.safetensors", arrays))


def test_a_file_of_gigabytes_is_refused_unread(tmp_path):
    path = changed(tmp_path / "m.safetensors")
    with path.open("r+b") as file:
        file.truncate(8 << 30)  # a file with a hole: it takes no room
    with pytest.raises(InputError, match=r"has 8.6 GB, more than the motion of half a day"):
        read_motion(path)


def test_earlier_files_without_up_and_floor_are_read(tmp_path):
    motion = read_motion(changed(tmp_path / "m.safetensors", {"up": None}, {"floor_m": None}))
    assert motion.up.tolist() == [0, 0, 1] and motion.floor_m == 0
