"""Files on a slow network drive: each is opened once and read in order."""

import sys
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.files import write_rig
from tests.sources import ring, write_recording
from voxelpose.recording import frame_reader
from voxelpose.recording.folder import Recording

OPENED: Counter[str] | None = None


def count(event: str, words: tuple) -> None:
    if event == "open" and OPENED is not None:
        OPENED[Path(str(words[0])).name] += 1


sys.addaudithook(count)  # cannot be removed


class Capture:
    """A video as OpenCV opens it, which counts how often that is done and where it goes."""

    opened, moves = 0, 0

    def __init__(self, address: str) -> None:
        type(self).opened += 1
        self._capture = OPEN(address)

    def set(self, what: int, value: float) -> bool:
        type(self).moves += 1
        return self._capture.set(what, value)

    def __getattr__(self, name: str):
        return getattr(self._capture, name)


OPEN = cv2.VideoCapture


def test_videos_are_read_once_and_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    recording = Recording.open(write_recording(tmp_path / "walk", ring(2)))
    monkeypatch.setattr(frame_reader.cv2, "VideoCapture", Capture)
    assert sum(1 for _ in recording) == recording.frame_count == 6
    assert (Capture.opened, Capture.moves) == (2, 0)


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_images_are_opened_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str):
    rig = ring(2)
    write_rig(rig, tmp_path / "calibration.toml")
    for number in range(10):
        for camera in rig:
            (tmp_path / camera.name).mkdir(exist_ok=True)
            picture = np.full((120, 160, 3), 10 * number, np.uint8)
            cv2.imwrite(str(tmp_path / camera.name / f"{number}.{suffix}"), picture)
    recording = Recording.open(tmp_path, fps=25)
    monkeypatch.setattr(sys.modules[__name__], "OPENED", Counter())
    assert sum(1 for _ in recording) == 10
    assert [OPENED[f"{number}.{suffix}"] for number in range(10)] == [2] * 10  # of two cameras
