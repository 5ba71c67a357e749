"""Damaged files of a recording are refused in one line, before they take time or memory."""

import json
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader, read_still
from voxelpose.recording.subject import read_subject
from voxelpose.recording.timestamps import read_timestamps
from voxelpose.recording.truth import read_truth, write_truth


def png(width: int, height: int, data: bytes = b"", stated: int | None = None) -> bytes:
    """A PNG of that size, whatever its data are."""
    chunks = b"\x89PNG\r\n\x1a\n"
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    for kind, content in ((b"IHDR", header), (b"IDAT", data), (b"IEND", b"")):
        length = stated if stated is not None and kind == b"IDAT" else len(content)
        chunks += struct.pack(">I", length) + kind + content
        chunks += struct.pack(">I", zlib.crc32(kind + content))
    return chunks


@pytest.mark.parametrize("size", [(20_000, 20_000), (2_000_000, 1_000)])
def test_an_image_of_gigabytes_is_refused_before_it_is_decoded(tmp_path, size):
    (tmp_path / "a.png").write_bytes(png(*size, zlib.compress(b"\0" * 100_000)))
    with pytest.raises(InputError, match=r"a\.png says .* at most 100 megapixels"):
        read_still(tmp_path / "a.png")


@pytest.mark.parametrize("content", [png(64, 48, b"abc", 0x80002000), b"", b"x" * 100])
def test_what_is_no_image_is_refused(tmp_path, content):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.png cannot be read as an image"):
        read_still(tmp_path / "a.png")


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tiff", ".webp", ".ppm"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_images_are_read_as_before(tmp_path, suffix, kind):
    if kind == np.uint16 and suffix not in (".png", ".tiff", ".ppm"):
        pytest.skip("has 8 bits")
    image = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (48, 64, 3), kind)
    path = tmp_path / f"a{suffix}"
    path.write_bytes(cv2.imencode(suffix, image)[1].tobytes())
    np.testing.assert_array_equal(read_still(path), cv2.imread(str(path)))


def reader(path: Path) -> FrameReader:
    return FrameReader(path, (), (4, 4), 2, 25.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('cam_id,frame_time\n1,0\n"' + "1,2\n" * 100_000, "field larger than field limit"),
        ("cam_id,frame_time\n1,0\n1,x\n", "line 3 is not cam_id,frame_time"),
        ("cam_id,frame_time\n1,0\n1,1e308\n", "are not all numbers of seconds"),
        ("cam_id,frame_time\n1,0\n1,nan\n", "are not all numbers of seconds"),
        ("cam_id,frame_time\n1,1\n1,0\n", "do not increase"),
        ("cam_id\n1\n", "no column frame_time"),
    ],
)
def test_damaged_timestamps(tmp_path, text, words):
    (tmp_path / "timestamps.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_timestamps(tmp_path / "timestamps.csv", {"cam_1": reader(tmp_path)})
    (tmp_path / "timestamps.csv").write_bytes(b"cam_id,frame_time\n1,\xff\n")
    with pytest.raises(InputError, match="cannot be read as CSV"):
        read_timestamps(tmp_path / "timestamps.csv", {"cam_1": reader(tmp_path)})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("stature = " + "9" * 5000, "no valid TOML"),
        ("stature = 9" + "0" * 300, "stature = 9000"),
        ("stature = nan", "stature = nan is impossible"),
        ("stature = 0.001", "give metres between 0.5 and 2.6"),
        ("chest_girth = [1]", "chest_girth = \\[1\\] is impossible"),
        ("stature = " + "[" * 5000, "nested|no valid TOML"),
        (f'body = "{"x" * 300}"', "is impossible: give a name of voxelpose body list"),
        ("body = 3", "is impossible: give a name of voxelpose body list"),
    ],
)
def test_damaged_subject(tmp_path, text, words):
    (tmp_path / "subject.toml").write_text(text)
    with pytest.raises(InputError, match=words) as error:
        read_subject(tmp_path / "subject.toml")
    assert "subject.toml" in str(error.value) and len(str(error.value)) < 400


@pytest.mark.parametrize("value", ["9" * 400, "1e308", "[]", "{}", "[" * 2000 + "]" * 2000, '"x"'])
def test_damaged_truth(tmp_path, value):
    path = tmp_path / "truth.json"
    write_truth(path, np.full((2, 15, 3), 1.5), 25.0, 1.7)
    text = path.read_text().replace("1.5", value, 1)
    path.write_text(text)
    with pytest.raises(InputError, match=r"truth\.json"):
        read_truth(path)
    path.write_text(json.dumps([1]))
    with pytest.raises(InputError, match=r"truth\.json cannot be read as a truth file"):
        read_truth(path)
