"""`voxelpose calibrate check` on recordings that are whole and on broken ones."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.files import read_rig, write_rig
from calib.moments import even_moments
from tests.sources import figure_masks, ring, turned, write_figure
from voxelpose.calibration.check import check_recording, exchanged
from voxelpose.cli import run
from voxelpose.recording.folder import Recording

FRAMES = 40


@pytest.fixture(scope="module")
def rig() -> Rig:
    # On two heights, or four cameras on one circle would hardly see each other's roll.
    cameras = list(ring(4, (240, 180)))
    for index in (1, 3):
        moved = cameras[index].translation - cameras[index].rotation @ np.array([0, 0, 0.5])
        cameras[index] = replace(cameras[index], translation=moved)
    return Rig(tuple(cameras))


@pytest.fixture(scope="module")
def films(rig):
    return {camera.name: figure_masks(camera, range(FRAMES)) for camera in rig}


def checked(capsys, *words: str) -> tuple[int, str]:
    code = run(["calibrate", "check", *words])
    return code, capsys.readouterr().out


def test_a_whole_recording_agrees(tmp_path: Path, rig, films, capsys):
    folder = write_figure(tmp_path, rig, films)
    code, refusal_of = checked(capsys, str(folder), "--png", str(tmp_path / "check.png"))
    assert code == 0 and "all 4 cameras agree" in refusal_of
    height, width, _ = cv2.imread(str(tmp_path / "check.png")).shape
    assert height > 300 and width > 600


def test_a_bumped_camera_is_named_and_repaired(tmp_path: Path, rig, films, capsys):
    folder = write_figure(tmp_path, turned(rig, "cam_3", 2), films)
    out = tmp_path / "repaired"
    code, refusal_of = checked(capsys, str(folder), "--repair", str(out))
    assert code == 1
    assert re.search(r"cam_3 was turned by about (2\.|1\.9)", refusal_of)
    assert "calibrate it again, or run with --repair" in refusal_of
    assert "with that put right: all 4 cameras agree" in refusal_of
    assert sorted(path.name for path in out.iterdir()) == ["calibration.toml"]
    assert pose_difference(read_rig(out / "calibration.toml")["cam_3"], rig["cam_3"])[1] < 0.4
    (folder / "calibration.toml").write_bytes((out / "calibration.toml").read_bytes())
    assert checked(capsys, str(folder))[0] == 0


def test_a_late_camera_is_named_and_synchronised(tmp_path: Path, rig, films, capsys):
    late = [films["cam_2"][max(0, frame - 4)] for frame in range(FRAMES)]
    folder = write_figure(tmp_path, rig, films | {"cam_2": late})
    code, refusal_of = checked(capsys, str(folder), "--repair", str(tmp_path / "repaired"))
    assert code == 1
    assert "cam_2 is out of step" in refusal_of and "late" in refusal_of
    (folder / "timestamps.csv").write_bytes((tmp_path / "repaired" / "timestamps.csv").read_bytes())
    assert Recording.open(folder).frame_count == FRAMES - 4
    assert checked(capsys, str(folder))[0] == 0


def test_swapped_cameras_are_reported_and_their_calibrations_exchanged(
    tmp_path: Path, rig, films, capsys
):
    folder = write_figure(tmp_path, rig, films | {"cam_1": films["cam_4"], "cam_4": films["cam_1"]})
    code, refusal_of = checked(capsys, str(folder), "--repair", str(tmp_path / "repaired"))
    assert code == 1 and "the videos of cam_1 and cam_4 are swapped" in refusal_of
    repaired = read_rig(tmp_path / "repaired" / "calibration.toml")
    assert repaired.names == rig.names
    np.testing.assert_allclose(repaired["cam_1"].center_m, rig["cam_4"].center_m, atol=1e-6)


def test_two_cameras_and_no_background_say_what_cannot_be_known(tmp_path: Path, rig, films, capsys):
    folder = write_figure(tmp_path, turned(rig, "cam_1", 4), films)
    few = "--moments", "4", "--most-late", "0"
    code, refusal_of = checked(capsys, str(folder), "--cameras", "cam_1,cam_2", *few)
    assert code == 1 and "only a third could tell" in refusal_of
    write_rig(rig, folder / "calibration.toml")
    for still in (folder / "background").iterdir():
        still.unlink()
    guessed = "no empty view of cam_1, cam_2"
    code, refusal_of = checked(capsys, str(folder), "--cameras", "cam_1,cam_2", *few)
    assert code == 0 and "not which one; a third tells" in refusal_of
    assert guessed not in refusal_of
    larger = Rig(ring(4, (320, 240)).cameras[:2])
    tiles = np.kron(np.indices((12, 16)).sum(axis=0) % 2, np.full((20, 20), 60)).astype(np.uint8)
    before_tiles = {
        camera.name: [np.maximum(one, tiles) for one in figure_masks(camera, range(16))]
        for camera in larger
    }
    (tmp_path / "tiles").mkdir()
    tiled = write_figure(tmp_path / "tiles", larger, before_tiles)
    for still in (tiled / "background").iterdir():
        still.unlink()
    assert guessed in checked(capsys, str(tiled), *few)[1]


def test_what_cannot_be_checked_is_refused(tmp_path: Path, rig, films, capsys):
    folder = write_figure(tmp_path, rig, {name: film[:6] for name, film in films.items()})
    for words, message in (
        (["--cameras", "cam_1"], "has one camera"),
        (["--moments", "2"], "--moments = '2' must be"),
        (["--most-late", "-1"], "--most-late = '-1' must be"),
        (["--repair", str(folder)], "exists"),
        (["--png", str(folder / "calibration.toml")], "exists"),
    ):
        assert run(["calibrate", "check", str(folder), *words]) == 2
        assert message in capsys.readouterr().err
    with pytest.raises(InputError, match="never sees somebody"):
        black = [np.zeros_like(film[0]) for film in films.values()][:1] * 6
        (tmp_path / "dark").mkdir()
        dark = write_figure(tmp_path / "dark", rig, dict.fromkeys(films, black))
        check_recording(Recording.open(dark))


def test_the_parts(rig):
    np.testing.assert_array_equal(even_moments(101, 3), [4, 50, 96])
    np.testing.assert_array_equal(even_moments(101, 3, margin=0), [0, 50, 100])
    assert len(even_moments(5, 12)) <= 5
    other = exchanged(rig, "cam_1", "cam_3")
    assert other.names == rig.names
    assert other["cam_1"].center_m.tolist() == rig["cam_3"].center_m.tolist()
