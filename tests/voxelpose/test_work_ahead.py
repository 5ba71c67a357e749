"""What a long estimation takes is told before it begins."""

from dataclasses import replace
from pathlib import Path

import pytest

from calib.errors import InputError
from tests.sources import ring, write_recording
from voxelpose import fitting
from voxelpose.recording.folder import Recording

HOURS = 2 * 3600 * 30


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return Recording.open(write_recording(tmp_path / "walk", ring(4)))


def disk(monkeypatch: pytest.MonkeyPatch, free: float) -> None:
    usage = type("Usage", (), {"free": free})
    monkeypatch.setattr(fitting.shutil, "disk_usage", lambda folder: usage)


def test_two_hours_of_four_cameras_are_announced(recording, monkeypatch):
    disk(monkeypatch, 50e9)
    assert fitting.work_ahead(recording, "multiview") == ""
    words = fitting.work_ahead(replace(recording, frame_count=HOURS), "multiview")
    assert words.startswith("216,000 frames of 4 cameras take about 16.8 hours on two cores, 13.0 ")
    assert words.endswith("(50 free), 4.3 GB for the result and 2.1 GB of memory")


def test_a_disk_without_room_is_refused(recording, monkeypatch):
    disk(monkeypatch, 12e9)
    with pytest.raises(InputError, match=r"about 13.0 GB in the .*, which has 12.0: set TMPDIR"):
        fitting.work_ahead(replace(recording, frame_count=HOURS), "multiview")
