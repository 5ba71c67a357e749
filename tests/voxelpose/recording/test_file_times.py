"""Frames paired by what files tell: presentation times of videos, numbers of images."""

import struct
import subprocess
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest

from calib.errors import InputError
from tests.voxelpose.recording.test_folder import (
    HEIGHT,
    WIDTH,
    number_of,
    numbers,
    picture,
    write_calibration,
    write_stills,
    write_video,
)
from voxelpose.calibration.sync import SyncSettings, _Films
from voxelpose.recording.ffmpeg import coded_pictures
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import even_numbers

COUNT = 20
LOST = "select='not(between(n,8,10))'"


def ffmpeg(*words: str | Path) -> None:
    program = imageio_ffmpeg.get_ffmpeg_exe()
    subprocess.run([program, "-y", "-v", "error", *map(str, words)], check=True)


def film(path: Path, how: str = "null", *words: str, fps: float = 25.0, count: int = COUNT) -> None:
    """A video of numbered pictures, encoded with frames out of order, that a filter thins out."""
    whole = path.with_name(f"{path.stem}_whole.avi")
    write_video(whole, count, fps)
    coded = ["-c:v", "libx264", "-qp", "8", "-bf", "3", "-pix_fmt", "yuv420p", *words]
    ffmpeg("-i", whole, "-vf", how, "-fps_mode", "passthrough", *coded, path)
    whole.unlink()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two cameras, twenty frames at 25 frames per second."""
    write_calibration(tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        film(tmp_path / f"{name}.mp4")
    return tmp_path


KEPT = [n for n in range(COUNT) if n not in (8, 9, 10)]


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "mov"])
def test_a_camera_that_lost_frames_stays_in_step(folder: Path, suffix: str):
    (folder / "cam_2.mp4").unlink()
    film(folder / f"cam_2.{suffix}", LOST)
    recording = Recording.open(folder)
    assert numbers(recording) == [(n, [n, n]) for n in KEPT]
    assert recording.fps == pytest.approx(25, rel=1e-3)
    np.testing.assert_allclose(recording.times_s, np.array(KEPT) / 25, atol=0.001)
    note = "by the times in the files, cam_2 lost 3 frames: frames are paired by them"
    assert recording.notes == (note,)
    late = Recording.open(folder, frames=(12, 15))
    assert numbers(late) == [(n, [n, n]) for n in (12, 13, 14)]
    assert [number_of(frames["cam_2"]) for frames in late.at([0, 2])] == [12, 14]
    with pytest.raises(InputError, match="lost frames 8:10"):
        Recording.open(folder, frames=(8, 10))


def test_cameras_that_stop_after_so_many_frames_are_paired_by_time(folder: Path):
    film(folder / "cam_2.mp4", LOST, count=COUNT + 3)
    # Both files have twenty frames.
    assert numbers(Recording.open(folder)) == [(n, [n, n]) for n in KEPT]


def test_a_camera_that_begins_late_is_paired_by_time(folder: Path):
    film(folder / "cam_2.mp4", "select='gte(n,4)'")
    recording = Recording.open(folder)
    assert numbers(recording) == [(n, [n, n]) for n in range(4, 20)]
    assert "cam_2 began 0.160 s later" in recording.notes[0]


def test_cameras_that_did_not_stop_together_are_asked_about(folder: Path):
    film(folder / "cam_2.mp4", LOST, count=15)
    with pytest.raises(InputError, match=r"did not stop together .* --frames 0:15.*sync") as caught:
        Recording.open(folder)
    assert "\n" not in str(caught.value)
    advised = Recording.open(folder, frames=(0, 15))
    assert numbers(advised) == [(n, [n, n]) for n in KEPT if n < 15]


def test_a_rate_that_varies_keeps_its_times(folder: Path):
    for name in ("cam_1", "cam_2"):
        film(folder / f"{name}.mp4", "select='lt(n,10)+not(mod(n,2))'")
    recording = Recording.open(folder)
    kept = [*range(10), 10, 12, 14, 16, 18]
    assert numbers(recording) == [(n, [n, n]) for n in kept]
    assert recording.fps == pytest.approx(25)
    np.testing.assert_allclose(recording.times_s, np.array(kept) / 25)
    assert "cam_1, cam_2 filmed 12.5 to 25 frames per second" in recording.notes[0]


def test_one_camera_keeps_its_times(folder: Path):
    film(folder / "cam_2.mp4", LOST)
    recording = Recording.open(folder, cameras=["cam_2"])
    assert numbers(recording) == [(n, [n]) for n in KEPT]
    assert "frames keep their times" in recording.notes[0]


def test_even_files_stay_as_they_are(folder: Path):
    film(folder / "cam_2.mp4", "null", "-use_editlist", "0")  # begins by the coding's delay
    recording = Recording.open(folder)
    assert numbers(recording) == [(n, [n, n]) for n in range(COUNT)]
    assert (recording.notes, recording.first, recording.fps) == ((), 0, 25.0)
    assert all(reader.numbers is None for reader in recording.readers.values())
    stream = folder / "cam_2.ts"  # its clock begins anywhere
    ffmpeg("-i", folder / "cam_2.mp4", "-c", "copy", "-output_ts_offset", "7", stream)
    (folder / "cam_2.mp4").unlink()
    assert Recording.open(folder).notes == ()


@pytest.mark.parametrize(("first", "end"), [(10, 20), (7, 20), (7, 15), (0, 15)])
def test_what_an_edit_list_cuts_off_is_no_frame(folder: Path, first: int, end: int):
    film(folder / "cam_1.mp4", "null", "-g", "50")
    data = bytearray((folder / "cam_1.mp4").read_bytes())
    lasting, begin = struct.unpack(">Ii", data[(place := data.find(b"elst") + 12) : place + 8])
    tick = 25 * lasting // COUNT  # a second of the file
    edit = tick * (end - first) // 25, begin + round(12800 / 25 * first)
    data[place : place + 8] = struct.pack(">Ii", *edit)
    (folder / "cam_2.mp4").write_bytes(data)
    reader = FrameReader.open(folder / "cam_2.mp4")
    assert [number_of(frame) for frame in reader] == list(range(first, end))
    assert reader.shown_s == pytest.approx(np.arange(end - first) / 25)
    assert Recording.open(folder, cameras=["cam_2"]).notes == ()


def test_a_rate_that_is_given_sets_times_aside(folder: Path):
    film(folder / "cam_2.mp4", LOST)
    recording = Recording.open(folder, frames=(0, 17), fps=25)
    assert numbers(recording)[8] == (8, [8, 11])
    assert "cam_2 lost 3 frames: --fps sets them aside" in recording.notes[0]


def test_rates_that_differ_a_little_drift_apart(folder: Path):
    for name, rate, count in (("cam_1", "25", "100"), ("cam_2", "124/5", "99")):
        source = f"color=size={WIDTH}x{HEIGHT}:rate={rate}"
        ffmpeg("-f", "lavfi", "-i", source, "-frames:v", count, folder / f"{name}.mp4")
    recording = Recording.open(folder)
    assert "rates differ (cam_1 25, cam_2 24.8 frames per second)" in recording.notes[0]
    first, second = (np.array(reader.numbers) for reader in recording.readers.values())
    assert len(first) == len(second) == 99
    assert np.abs(first / 25 - second / 24.8).max() <= 0.5 / 24.8


def test_without_times_nothing_is_said(folder: Path, monkeypatch: pytest.MonkeyPatch):
    film(folder / "cam_2.mp4", LOST)

    def missing() -> str:
        raise RuntimeError("none")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", missing)
    assert coded_pictures(folder / "cam_2.mp4").count == 0
    with pytest.raises(InputError, match=r"cam_1 20, cam_2 17 frames"):
        Recording.open(folder)


def stills(folder: Path, count: int = 12, first: int = 0, lost: tuple[int, ...] = ()) -> None:
    folder.mkdir()
    for number in range(count):
        if number not in lost:
            cv2.imwrite(str(folder / f"shot_{number + first:04d}.png"), picture(number))


@pytest.fixture
def images(tmp_path: Path) -> Path:
    write_calibration(tmp_path / "calibration.toml")
    stills(tmp_path / "cam_1")
    return tmp_path


def test_images_are_paired_by_number(images: Path):
    stills(images / "cam_2", lost=(4, 5, 9))
    recording = Recording.open(images, fps=10)
    kept = [n for n in range(12) if n not in (4, 5, 9)]
    assert numbers(recording) == [(n, [n, n]) for n in kept]
    assert recording.fps == 10
    (note,) = recording.notes
    assert "by the numbers of the images, cam_2 lost 3 images (4 to 5, 9): frames are" in note


@pytest.mark.parametrize(
    ("first", "lost", "words"), [(1, 6, "cam_2 lost 1 image"), (0, 0, "cam_2 began with image 1")]
)
def test_images_may_count_from_one_or_lack_the_first(images: Path, first, lost, words):
    stills(images / "cam_2", first=first, lost=(lost,))
    recording = Recording.open(images, fps=10)
    assert numbers(recording) == [(n, [n, n]) for n in range(12) if n != lost]
    assert words in recording.notes[0]


def test_numbers_follow_the_clock():
    steps = np.arange(3000)
    taken, period = even_numbers(np.round(steps / 240, 3))  # a container that counts milliseconds
    assert (taken == steps).all() and period == pytest.approx(1 / 240, rel=1e-4)
    slower = np.concatenate([np.arange(300) / 30, 10 + np.arange(240) / 24])  # no step is two
    taken, period = even_numbers(slower)
    assert np.abs(taken * period - slower).max() < period
    assert period == pytest.approx(1 / 30)


def test_the_clock_of_a_varying_camera_is_what_sync_moves(folder: Path):
    film(folder / "cam_2.mp4", LOST)
    films = _Films.open(folder, SyncSettings(), None)
    np.testing.assert_allclose(films.times["cam_2"], np.array(KEPT) / 25)
    assert films.fps["cam_2"] == pytest.approx(25)
    assert "cam_2 lost 3 frames" in films.notes[0]


UNITS = {"ms": 1000, "us": 10**6, "ns": 10**9}


def table(folder: Path, per_second: int, column: str = "frame_time", epoch: float = 0) -> None:
    rows = [f"{c},{round((epoch + n / 25) * per_second)}" for n in range(COUNT) for c in (1, 2)]
    (folder / "timestamps.csv").write_text(f"cam_id,{column}\n" + "\n".join(rows) + "\n")


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("epoch", [0, 1_700_000_000])
def test_the_unit_of_timestamps_is_what_the_videos_rate_tells(folder: Path, unit: str, epoch: int):
    table(folder, UNITS[unit], epoch=epoch)
    recording = Recording.open(folder)
    assert recording.fps == pytest.approx(25, rel=1e-4)
    assert f"is taken to count in {unit}" in recording.notes[0]
    table(folder, UNITS[unit], f"frame_time_{unit}", epoch)
    assert Recording.open(folder).notes == ()


def test_a_unit_that_nothing_tells_is_asked_about(folder: Path):
    table(folder, 1200)
    remedy = r"cam_1: 0\.0208\d* frames per second are outside 1 to 1,000: .*frame_time_ms"
    with pytest.raises(InputError, match=remedy) as caught:
        Recording.open(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("fps", [0.02, 1001, float("nan"), -1])
def test_a_rate_that_no_camera_has_is_asked_about(folder: Path, fps: float):
    with pytest.raises(InputError, match="outside 1 to 1,000"):
        Recording.open(folder, fps=fps)


def test_one_still_per_camera_needs_no_rate(tmp_path: Path):
    write_calibration(tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        write_stills(tmp_path / name, 1)
    assert Recording.open(tmp_path).frame_count == 1
