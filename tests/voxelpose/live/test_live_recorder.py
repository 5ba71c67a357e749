import subprocess
import sys

import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import ring
from voxelpose.live import live_recorder
from voxelpose.live.camera_source import Shot
from voxelpose.live.live_recorder import LiveRecorder
from voxelpose.recording.folder import Recording
from voxelpose.recording.subject import Subject

RIG = ring(2)
PERSON = Subject(1.75, None, "female")


def shot(number: int, cameras: tuple[str, ...] = RIG.names) -> Shot:
    """A grey moment, lighter from frame to frame."""
    pictures = {name: np.full((120, 160, 3), 40 + 10 * (number % 20), np.uint8) for name in cameras}
    return Shot(number, number / 30, pictures)


def empty() -> dict[str, list[np.ndarray]]:
    return {name: [np.full((120, 160, 3), 20, np.uint8)] * 3 for name in RIG.names}


def test_a_recording_can_be_opened(tmp_path):
    recorder = LiveRecorder(tmp_path / "r", RIG, PERSON, empty())
    for number in range(6):
        recorder.put(shot(number))
    recorder.close()
    recording = Recording.open(tmp_path / "r")
    assert recording.frame_count == recorder.written == 6
    assert recording.fps == pytest.approx(30, abs=0.01)
    assert recording.subject == PERSON
    levels = [frames["cam_1"].mean() for _, _, frames in recording]
    assert np.allclose(levels, 40 + 10 * np.arange(6), atol=2)
    assert set(recording.backgrounds()) == set(RIG.names)


def test_a_private_recording_keeps_outlines_only(tmp_path):
    recorder = LiveRecorder(tmp_path / "r", RIG, PERSON, empty(), private=True)
    masks = {name: np.tri(120, 160, dtype=bool) for name in RIG.names}
    recorder.put(shot(0))  # before silhouettes are known
    recorder.put(shot(1), masks)
    recorder.close()
    kept = {path.suffix for path in (tmp_path / "r").rglob("*") if path.is_file()}
    assert kept == {".toml", ".csv", ".png"}
    assert not (tmp_path / "r" / "background").exists()
    recording = Recording.open(tmp_path / "r", fps=30)
    assert recording.silhouettes_given
    (_, _, frames), *others = recording
    assert not others
    assert np.array_equal(frames["cam_1"][..., 0] > 127, masks["cam_1"])


def test_silhouettes_of_reduced_pictures_have_the_cameras_size(tmp_path):
    recorder = LiveRecorder(tmp_path / "r", RIG, PERSON, empty(), private=True)
    recorder.put(shot(0), {name: np.tri(90, 120, dtype=bool) for name in RIG.names})
    recorder.close()
    ((_, _, frames),) = Recording.open(tmp_path / "r", fps=30)
    whole = np.tri(120, 160, dtype=bool)
    assert ((frames["cam_1"][..., 0] > 127) != whole).sum() < 160
    assert set(np.unique(frames["cam_1"])) == {0, 255}


def test_a_moment_without_one_of_the_cameras_is_left_out(tmp_path):
    recorder = LiveRecorder(tmp_path / "r", RIG, PERSON, {})
    recorder.put(shot(0))
    recorder.put(shot(1, ("cam_1",)))
    recorder.put(shot(2))
    recorder.close()
    assert recorder.written == 2
    assert Recording.open(tmp_path / "r").frame_count == 2


def test_an_existing_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="exists"):
        LiveRecorder(tmp_path, RIG, PERSON, {})


def test_recording_ends_before_the_disk_is_full(tmp_path, monkeypatch):
    monkeypatch.setattr(live_recorder, "_LEAST_FREE", 1 << 62)
    recorder = LiveRecorder(tmp_path / "r", RIG, PERSON, {})
    recorder.put(shot(0))
    recorder.close()
    assert "left on the disk" in recorder.failure
    assert recorder.written == 0


FULL = """
import resource, signal, sys
from pathlib import Path
from tests.voxelpose.live.test_live_recorder import PERSON, RIG, shot
from voxelpose.live.live_recorder import LiveRecorder

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # a write beyond the limit then fails
recorder = LiveRecorder(Path(sys.argv[1]), RIG, PERSON, {})
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
for number in range(40):
    recorder.put(shot(number))
recorder.close()
print(recorder.written, recorder.failure)
"""


def test_what_was_written_before_the_disk_was_full_can_be_read(tmp_path):
    """timestamps.csv must not grow beyond 1000 bytes, which is in the middle of a line."""
    words = [sys.executable, "-c", FULL, str(tmp_path / "r")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    written, _, failure = done.stdout.partition(" ")
    assert "recording ended" in failure
    assert 0 < int(written) < 40
    recording = Recording.open(tmp_path / "r")
    assert recording.frame_count == int(written)
    assert len(list(recording)) == int(written)
