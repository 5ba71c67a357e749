"""OpenCV's FileStorage: what OpenCV writes is read without it, and it reads what is written."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from rigs import BENT, FISHEYE, PINHOLE, RATIONAL, some_rig

from calib.errors import InputError
from calib.files import read_rig, write_rig
from calib.files.file_storage import dump_storage, load_storage

SYNTAXES = ("yml", "xml", "json")
ENTRIES = {
    "unit": "m",
    "spaced": "two words",
    "empty": "",
    "quoted": 'say "hi" & <x>',
    "digits": "01",
    "long_text": "x" * 300,
    "whole": 5,
    "tiny": 1e-30,
    "large": -1.5e300,
    "nan": float("nan"),
    "infinite": float("-inf"),
    "doubles": np.array([[1, 2.5], [np.nan, -np.inf]]),
    "long_rows": np.arange(40).reshape(1, 40) / 7,
    "floats": np.array([[0.1, 2]], np.float32),
    "integers": np.array([[1, -2]], np.int32),
    "bytes": np.arange(6, dtype=np.uint8).reshape(2, 3),
    "points": np.arange(12.0).reshape(2, 2, 3),
    "one": np.ones((1, 1)),
}


def by_opencv(path: Path, entries: dict, flags: int = 0) -> Path:
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE | flags)
    for key, value in entries.items():
        file.write(key, value)
    file.startWriteStruct("names", cv2.FileNode_SEQ)
    for name in ("01", "b", 3):
        file.write("", name)
    file.endWriteStruct()
    file.startWriteStruct("camera", cv2.FileNode_MAP)
    file.startWriteStruct("inner", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
    file.write("", 2.5)
    file.write("", 4)
    file.endWriteStruct()
    file.endWriteStruct()
    file.writeComment("a comment", False)
    file.release()
    return path


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_what_opencv_writes_is_read(tmp_path, syntax):
    content = load_storage(by_opencv(tmp_path / f"a.{syntax}", ENTRIES))
    assert content["names"] == ["01", "b", 3.0]
    assert content["camera"] == {"inner": [2.5, 4.0]}
    for key, value in ENTRIES.items():
        if isinstance(value, str):
            assert content[key] == value
        else:
            np.testing.assert_array_equal(content[key], value)
            if isinstance(value, np.ndarray):
                assert content[key].dtype == value.dtype


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_base64_data_are_read(tmp_path, syntax):
    flag = cv2.FILE_STORAGE_WRITE_BASE64
    matrices = {key: value for key, value in ENTRIES.items() if isinstance(value, np.ndarray)}
    content = load_storage(by_opencv(tmp_path / f"a.{syntax}", matrices, flag))
    for key, value in matrices.items():
        np.testing.assert_array_equal(content[key], value)


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_opencv_reads_what_is_written(tmp_path, syntax):
    rig = some_rig(PINHOLE, BENT, RATIONAL, FISHEYE)
    path = tmp_path / f"rig.{syntax}"
    write_rig(rig, path, style="opencv")
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert file.getNode("unit").string() == "m"
    for camera in rig:
        node = file.getNode(camera.name)
        np.testing.assert_array_equal(node.getNode("camera_matrix").mat(), camera.matrix)
        np.testing.assert_array_equal(node.getNode("rotation").mat(), camera.rotation)
        np.testing.assert_array_equal(node.getNode("translation").mat()[:, 0], camera.translation)
        assert node.getNode("image_width").real() == camera.size[0]
    file.release()
    write_rig(some_rig(BENT), tmp_path / "folder")
    file = cv2.FileStorage(str(tmp_path / "folder" / "intri.yml"), cv2.FILE_STORAGE_READ)
    assert file.getNode("names").at(0).string() == "cam_1"
    assert file.getNode("dist_cam_1").mat().shape == (1, 5)


@pytest.mark.parametrize("syntax", SYNTAXES)
def test_text_and_lists_survive_a_round_trip(tmp_path, syntax):
    content = {"names": ["a", "02"], "text": "b c", "number": 7, "deep": {"er": {"n": -1}}}
    dump_storage(content, tmp_path / f"a.{syntax}")
    assert load_storage(tmp_path / f"a.{syntax}") == content


def matrix(rows: str = "1", cols: str = "2", dt: str = "d", data: str = "[ 1., 2. ]") -> str:
    fields = f"   rows: {rows}\n   cols: {cols}\n   dt: {dt}\n   data: {data}\n"
    return f"%YAML:1.0\n---\nA: !!opencv-matrix\n{fields}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (matrix(rows="-1"), "A has rows and cols"),
        (matrix(cols="-2147483648"), "A has rows and cols"),
        (matrix(rows="1e308"), "A has rows and cols"),
        (matrix(rows=".Nan"), "A has rows and cols"),
        (matrix(rows="9" * 5000), "A has rows and cols"),
        (matrix(rows="500000", cols="500000"), "A announces 500000 x 500000 x 1 numbers"),
        (matrix(cols="3"), "A announces 1 x 3 x 1 numbers, its data hold 2"),
        (matrix(data="[ 1., x ]"), "its data hold what is no number"),
        (matrix(data='"$base64$%%"'), "A announces 1 x 2 x 1 numbers"),
        (matrix(dt="9z"), "A has dt '9z', no type"),
        (matrix(dt="99d"), "A announces 1 x 2 x 99 numbers"),
        (matrix(dt="u", data="[ 1, 1e300 ]"), "A holds numbers beyond its dt u"),
        ("%YAML:1.0\n---\na: &x [1]\nb: *x\n", "anchors or aliases"),
        # PyYAML itself refuses this one from 6.0.4 on.
        ("%YAML:1.0\n---\na: " + "[" * 5000, "nested as no FileStorage is|nesting depth"),
        ("%YAML:1.0\n---\na: " + "{a: " * 5000, "nested as no FileStorage is"),
        ("%YAML:1.0\n---\n[1]: 2\n", "nested as no FileStorage is"),
        ("%YAML:1.0\n---\n- 1\n", "not an OpenCV FileStorage"),
        ("%YAML:1.0\n---\na: [1\nb: }\n", "OpenCV cannot read it: .* in line"),
        ("%YAML:1.0\n---\na: \x00\n", "OpenCV cannot read it"),
        ('{"a": [1, 2', "broken JSON"),
        ('<?xml version="1.0"?><opencv_storage><a>1<b/></a></opencv_storage>', "mixes text"),
        ('<?xml version="1.0"?><other/>', "not an OpenCV FileStorage"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage/>', "has a document type"),
    ],
)
def test_what_made_opencv_crash_is_one_line(tmp_path, text, message):
    path = tmp_path / "a.yml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        load_storage(path)
    assert str(path) in str(caught.value) and len(str(caught.value)) < 400


def test_a_huge_calibration_is_refused_unread(tmp_path):
    with (tmp_path / "rig.yml").open("wb") as file:
        file.write(b"%YAML:1.0\n---\n")
        file.truncate(50_000_000)
    with pytest.raises(InputError, match="larger than the 10 MB"):
        read_rig(tmp_path / "rig.yml")
