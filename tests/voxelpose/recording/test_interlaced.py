"""Videos flagged as interlaced, which OpenCV 5 leaves unconverted, show what was filmed."""

from pathlib import Path

import numpy as np
import pytest

from tests.sources import write_film
from tests.voxelpose.recording.test_file_times import ffmpeg
from tests.voxelpose.recording.test_folder import write_calibration
from voxelpose.recording import frame_reader
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import FrameReader

WIDTH, HEIGHT, COUNT = 96, 64, 6
FIELDS = ["-flags", "+ildct+ilme"]
H264 = ["-c:v", "libx264", "-qp", "4", *FIELDS, "-x264-params"]


def bar(moment: float) -> np.ndarray:
    """A picture of a bar that moves by 8 px from one to the next."""
    picture = np.full((HEIGHT, WIDTH, 3), 60, np.uint8)
    left = 8 + round(8 * moment)
    picture[16:48, left : left + 16] = 200
    return picture


def write(path: Path, pictures: list[np.ndarray], *words: str | Path) -> Path:
    source = write_film(path.with_name("source.avi"), pictures, code="FFV1")
    ffmpeg("-i", source, *words, path)
    return path


def off(reader: FrameReader, pictures: list[np.ndarray]) -> float:
    """Largest mean difference from what was filmed, grey levels."""
    pairs = zip(reader, pictures, strict=True)
    return max(float(np.abs(frame.astype(int) - true).mean()) for frame, true in pairs)


def woven(bottom_first: bool) -> list[np.ndarray]:
    """Pictures whose upper field is half a period from their lower one."""
    pictures = [bar(k) for k in range(COUNT)]
    for k, picture in enumerate(pictures):
        picture[1 - bottom_first :: 2] = bar(k + 0.5)[1 - bottom_first :: 2]
    return pictures


@pytest.mark.parametrize("first", ["tff", "bff"])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.mts", [*H264, "{}=1"]),
        ("a.mpg", ["-c:v", "mpeg2video", "-q:v", "2", *FIELDS]),
        ("a.avi", ["-c:v", "mpeg4", "-q:v", "2", *FIELDS]),
        ("a.mkv", ["-c:v", "ffv1"]),
        ("a.mov", ["-c:v", "prores_ks", "-pix_fmt", "yuv422p10le", *FIELDS]),
    ],
)
def test_pictures_flagged_as_interlaced_are_what_was_filmed(tmp_path, first, name, words):
    words = [word.format(first) for word in words]
    for pictures, most in (([bar(k) for k in range(COUNT)], 2.0), (woven(first == "bff"), 4.0)):
        path = write(tmp_path / name, pictures, "-vf", f"setfield={first},format=yuv420p", *words)
        reader = FrameReader.open(path)
        assert reader.coded.interlaced
        assert off(reader, [bar(k) for k in range(COUNT)]) < most
        assert off(reader.select([3, 4, 4]), [bar(3), bar(4), bar(4)]) < most


def test_a_video_that_becomes_interlaced_is_read_on(tmp_path: Path):
    pictures = [bar(k) for k in range(COUNT)]
    plain, fields = tmp_path / "a.ts", tmp_path / "b.ts"
    write(plain, pictures, "-c:v", "libx264", "-qp", "4", "-pix_fmt", "yuv420p")
    write(fields, pictures, "-vf", "setfield=tff,format=yuv420p", *H264, "tff=1")
    ffmpeg("-i", f"concat:{plain}|{fields}", "-c", "copy", tmp_path / "c.ts")
    reader = FrameReader.open(tmp_path / "c.ts")
    assert not reader.coded.interlaced
    assert off(reader, pictures + pictures) < 2
    for number in (COUNT, COUNT + 2):
        assert off(reader.select([number]), pictures[number - COUNT :][:1]) < 2


def test_pictures_that_stay_the_same_are_looked_into_once(tmp_path, monkeypatch):
    path = write(tmp_path / "a.mkv", [bar(0)] * COUNT, "-c:v", "ffv1")
    asked = []
    monkeypatch.setattr(frame_reader, "has_fields", lambda *file: asked.append(file))
    assert off(FrameReader.open(path), [bar(0)] * COUNT) == 0
    assert {*asked} == {(path, path.stat().st_mtime_ns)}


def test_a_recording_tells_which_cameras_are_interlaced(tmp_path: Path):
    write_calibration(tmp_path / "calibration.toml")
    for name, words in (("cam_1", ["-c:v", "ffv1"]), ("cam_2", ["-vf", "setfield=tff"])):
        write(tmp_path / f"{name}.mkv", [bar(k) for k in range(COUNT)], *words, "-c:v", "ffv1")
    (tmp_path / "source.avi").unlink()
    (note,) = Recording.open(tmp_path).notes
    assert note.startswith("cam_2: flagged as interlaced")


@pytest.mark.parametrize(
    "words",
    [
        *(["-c:v", "ffv1", "-pix_fmt", f] for f in ("yuv410p", "yuv444p10le", "gbrp12le", "ya8")),
        *(["-c:v", "ffv1", "-pix_fmt", f] for f in ("gray", "gray10le", "yuva420p", "bgra")),
        *(["-c:v", "libx264", "-qp", "4", "-pix_fmt", f] for f in ("yuv444p10le", "yuvj444p")),
        ["-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p"],
        ["-c:v", "libx265", "-x265-params", "crf=4:log-level=none", "-pix_fmt", "yuv444p12le"],
    ],
)
def test_any_format_of_pixels_is_converted(tmp_path: Path, words: list[str]):
    size = (WIDTH - 1, HEIGHT - 1)  # half a pixel of colour is left over
    pictures = [bar(k)[: size[1], : size[0]] for k in range(COUNT)]
    crop = ["-vf", f"crop={size[0]}:{size[1]}:0:0:1"]
    whole = [bar(k) for k in range(COUNT)]
    reader = FrameReader.open(write(tmp_path / "a.mkv", whole, *crop, *words))
    assert (reader.size, reader.coded.interlaced) == (size, False)
    assert off(reader, pictures) < 3
