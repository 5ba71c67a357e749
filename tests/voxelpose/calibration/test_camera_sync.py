"""`voxelpose calibrate sync`: cameras that were started by hand."""

from pathlib import Path

import numpy as np
import pytest

from calib.camera import Rig
from tests.sources import figure_masks, ring, write_figure
from voxelpose.cli import run
from voxelpose.recording.folder import Recording

BEGIN = {"cam_1": 3.0, "cam_2": 0.0, "cam_3": 5.5}
FPS = 25.0


@pytest.fixture(scope="module")
def rig() -> Rig:
    return ring(3, (320, 240))


def film(rig: Rig, begin: dict[str, float], count: int = 40) -> dict[str, list[np.ndarray]]:
    return {
        camera.name: figure_masks(camera, begin[camera.name] + np.arange(count)) for camera in rig
    }


def test_offsets_are_found_written_and_used(tmp_path: Path, rig, capsys):
    folder = write_figure(tmp_path, rig, film(rig, BEGIN))
    assert run(["calibrate", "check", str(folder), "--moments", "4", "--most-late", "0"]) == 1
    capsys.readouterr()
    sync = ["calibrate", "sync", str(folder), "--most", "0.6", "--reference", "cam_2"]
    assert run([*sync, "--out", str(folder / "timestamps.csv")]) == 0
    assert "its clock counts" in capsys.readouterr().out
    rows = [line.split(",") for line in (folder / "timestamps.csv").read_text().splitlines()]
    assert rows[0] == ["cam_id", "frame_time"]
    first = {name: float(time) for name, time in reversed(rows[1:])}
    first_frames = [first[name] * FPS for name in rig.names]
    np.testing.assert_allclose(first_frames, list(BEGIN.values()), atol=0.15)
    assert 30 <= Recording.open(folder).frame_count <= 35
    assert run(["calibrate", "check", str(folder)]) == 0


def test_a_recording_in_step_has_no_offsets(tmp_path: Path, rig, capsys):
    folder = write_figure(tmp_path, rig, film(rig, dict.fromkeys(rig.names, 0.0), 30))
    assert run(["calibrate", "sync", str(folder), "--most", "0.4"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    late = [float(line[2]) for line in lines if line and line[0] in ("cam_2", "cam_3")]
    np.testing.assert_allclose(late, 0, atol=0.1)


def test_pictures_that_a_camera_repeats_are_left_out(tmp_path: Path, rig, capsys):
    films = film(rig, dict.fromkeys(rig.names, 0.0), 30)
    films["cam_2"][12:18] = [films["cam_2"][11]] * 6
    folder, out = write_figure(tmp_path, rig, films), tmp_path / "timestamps.csv"
    assert run(["calibrate", "sync", str(folder), "--most", "0.4", "--out", str(out)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "cam_2 repeats the picture before in 6 frames (12 to 17)" in said
    assert len(out.read_text().splitlines()) == 1 + 3 * 30


def test_what_cannot_be_synchronised_is_refused(tmp_path: Path, rig, capsys):
    still = {camera.name: figure_masks(camera, [7.0] * 20) for camera in rig}
    folder = write_figure(tmp_path, rig, still)
    (folder / "old.csv").write_text("")
    for words, message in (
        ([], "nobody moves in cam_1"),
        (["--cameras", "cam_1"], "has one camera"),
        (["--out", str(folder / "old.csv")], "exists"),
        (["--most", "-1"], "--most = '-1.0' must be"),
        (["--seconds", "0"], "--seconds = '0.0' must be"),
        (["--rates", "cam_1:30"], "--rates cam_1:30 is not understood"),
    ):
        assert run(["calibrate", "sync", str(folder), *words]) == 2
        assert message in capsys.readouterr().err
