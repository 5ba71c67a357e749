import sys
from contextlib import suppress
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest

from calib.errors import InputError
from voxelpose.view.images.webm import WebmWriter

SIZE = (97, 63)


def grey(level: int) -> np.ndarray:
    return np.full((SIZE[1], SIZE[0], 3), level, np.uint8)


def program(folder: Path, code: str) -> str:
    """A program that stands in for FFmpeg."""
    path = folder / "ffmpeg"
    path.write_text(f"#!{sys.executable}\n{code}\n")
    path.chmod(0o755)
    return str(path)


def test_frames_come_back_in_order_with_rate_and_size(tmp_path):
    writer = WebmWriter(tmp_path / "a.webm", 29.97, SIZE)
    for level in (40, 120, 200):
        writer.write(grey(level))
    writer.close()
    capture = cv2.VideoCapture(str(tmp_path / "a.webm"))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(29.97, abs=0.01)
    images = [capture.read()[1] for _ in range(3)]
    assert [image.shape for image in images] == [grey(0).shape] * 3
    np.testing.assert_allclose([image.mean() for image in images], (40, 120, 200), atol=4)


@pytest.mark.parametrize("code", ["raise SystemExit(1)", "import sys; sys.stdin.buffer.read()"])
def test_an_encoder_that_ends_early_or_writes_nothing_is_an_error(tmp_path, monkeypatch, code):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", program(tmp_path, code))
    writer = WebmWriter(tmp_path / "a.webm", 30, SIZE)
    with pytest.raises(OSError, match="FFmpeg ended before all frames were written"):
        for _ in range(200):
            writer.write(grey(90))
        writer.close()
    writer.release()


def test_a_frame_that_is_missing_is_an_error(tmp_path):
    writer = WebmWriter(tmp_path / "a.webm", 30, SIZE)
    for _ in range(4):
        writer.write(grey(90))
    writer.frames += 1
    with pytest.raises(OSError, match="before all frames"):
        writer.close()


def test_without_ffmpeg_the_remedy_is_named(tmp_path, monkeypatch):
    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    with pytest.raises(InputError, match=r"IMAGEIO_FFMPEG_EXE.*--no-pictures"):
        WebmWriter(tmp_path / "a.webm", 30, SIZE)


def test_no_process_stays(tmp_path):
    writer = WebmWriter(tmp_path / "left.webm", 30, SIZE)
    writer.write(grey(90))
    writer.release()
    writer.release()
    if not Path("/proc").is_dir():
        pytest.skip("processes are listed in /proc, which this machine has not")
    running = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended in the meantime
            running.append(file.read_bytes())
    assert running
    assert not any(b"left.webm" in line for line in running)
