"""Cameras that were started by hand and film at different rates, before there is a calibration."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.board_scene import BoardCamera, align_rigs, carried, room, without_poses
from benchmarks.board_scene import seen as seen_board
from calib.board import Board, BoardView, view_between
from calib.camera import Camera, Rig
from calib.extrinsics import pose_difference
from calib.files import read_rig, write_rig
from calib.signals import SignalSettings, offsets_from_signals
from tests.sources import figure_masks, ring, write_figure, write_film
from tests.voxelpose.recording.test_sound import clap_at, write_heard
from voxelpose.calibration.board_views import frames_around
from voxelpose.calibration.sync import board_speed
from voxelpose.cli import run

BOARD = Board(8, 5, 0.15)
RATES = {"cam_0": 10.0, "cam_1": 12.5, "cam_2": 20.0}
BEGIN_S = {"cam_0": 0.3, "cam_1": 0.0, "cam_2": 0.71}


def first_times(path: Path) -> dict[str, float]:
    rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
    return {name: float(time_s) for name, time_s in reversed(rows)}


def told(capsys, *words) -> str:
    assert run([str(word) for word in words]) == 2
    return " ".join(capsys.readouterr().err.split())


def squats(camera: Camera, time_s: np.ndarray) -> list[np.ndarray]:
    """Silhouettes of a column of balls that bends its knees and walks about."""
    masks = []
    for moment in time_s:
        mask = np.zeros(camera.size[::-1], np.uint8)
        tall = 1 + 0.12 * (np.sin(4.1 * moment) + np.sin(6.7 * moment + 1) + np.sin(2.3 * moment))
        for height_m in np.linspace(0.2, 1.4, 7):
            place = np.array([[0.3 * np.sin(1.3 * moment), 0.2 * moment - 0.4, height_m * tall]])
            (pixel,), (depth,) = camera.project(place)
            x, y = (int(value) for value in np.round(pixel * 16))
            radius = int(16 * camera.matrix[0, 0] * 0.17 / depth)
            cv2.circle(mask, (x, y), radius, 255, cv2.FILLED, cv2.LINE_8, 4)
        masks.append(mask)
    return masks


@pytest.fixture(scope="module")
def figure(tmp_path_factory) -> tuple[Path, dict[str, float]]:
    """Somebody who never does the same twice, without a calibration."""
    rig, folder = ring(3, (320, 240)), tmp_path_factory.mktemp("figure")
    begin_s = {"cam_1": 0.35, "cam_2": 0.0, "cam_3": 0.61}
    films = {
        camera.name: squats(camera, begin_s[camera.name] + np.arange(100) / 25) for camera in rig
    }
    write_figure(folder, rig, films)
    (folder / "calibration.toml").unlink()
    return folder, begin_s


def test_silhouettes_need_no_calibration(figure, tmp_path, capsys):
    folder, begin_s = figure
    out = tmp_path / "timestamps.csv"
    assert run(["calibrate", "sync", str(folder), "--most", "1", "--out", str(out)]) == 0
    output = capsys.readouterr().out
    assert "by silhouettes moving up and down: pairs of cameras correlate by" in output
    found = first_times(out)
    for name, begin in begin_s.items():
        assert found[name] - found["cam_2"] == pytest.approx(begin, abs=0.02)


def test_what_is_missing_is_named(figure, tmp_path, capsys):
    folder, _ = figure
    start = ["calibrate", "sync", folder]
    assert "choose --by silhouettes" in told(capsys, *start, "--by", "geometry")
    assert "give --board, as in --board 8x5" in told(capsys, *start, "--by", "board")
    assert "give --intrinsics" in told(capsys, *start, "--board", "8x5")
    assert "recorded no sound" in told(capsys, *start, "--by", "sound")
    assert "there is no video of cam_9" in told(capsys, *start, "--cameras", "cam_1,cam_9")
    assert "there is no camera cam_9" in told(capsys, *start, "--reference", "cam_9")
    assert "0.01 s of cam_1 are" in told(capsys, *start, "--seconds", "0.01")
    assert "has no video" in told(capsys, "calibrate", "sync", tmp_path)
    assert "is not a recording" in told(capsys, "calibrate", "sync", tmp_path / "none")
    write_rig(without_poses(ring(3, (320, 240))), tmp_path / "lenses.toml")
    lenses = ["--intrinsics", tmp_path / "lenses.toml"]
    assert "cam_1 saw the board in 0 of" in told(capsys, *start, "--board", "8x5", *lenses)


def test_offsets_that_are_unsure_are_not_written(tmp_path, capsys):
    rig = ring(2, (320, 240))
    films = {camera.name: figure_masks(camera, range(60)) for camera in rig}
    folder = write_figure(tmp_path, rig, films)
    out = tmp_path / "timestamps.csv"
    words = ["calibrate", "sync", str(folder), "--by", "silhouettes", "--most", "1"]
    assert run([*words, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert "other offsets are nearly as likely for cam_1, cam_2" in captured.out
    assert "was not written: let somebody squat" in " ".join(captured.err.split())
    assert not out.exists()


def test_a_clap_is_enough(tmp_path, capsys):
    for seed, (name, fps, clap_s) in enumerate((("cam_1", 25, 2.5), ("cam_2", 30, 1.266))):
        heard = clap_at(4, clap_s, clap_s + 0.7, seed=seed)
        write_heard(tmp_path / f"{name}.mp4", heard, fps)
    out = tmp_path / "timestamps.csv"
    assert run(["calibrate", "sync", str(tmp_path), "--out", str(out)]) == 0
    assert "by sound: pairs of cameras correlate by" in capsys.readouterr().out
    found = first_times(out)
    assert found["cam_2"] - found["cam_1"] == pytest.approx(2.5 - 1.266, abs=0.004)


def test_sound_that_differs_gives_way_to_silhouettes(tmp_path, capsys):
    for name, claps in (("cam_1", (0.9, 2.2)), ("cam_2", (1.5, 1.8, 3.4))):
        write_heard(tmp_path / f"{name}.mp4", clap_at(4, *claps))
    assert "nobody" in told(capsys, "calibrate", "sync", tmp_path)


@pytest.fixture(scope="module")
def walk() -> Rig:
    return room(3, 2.4, size=(480, 360), arc_deg=80)


def test_a_board_has_one_speed_for_all_cameras(walk):
    path, rng = carried(walk, 22, 1), np.random.default_rng(0)
    signals = []
    for camera in walk:
        time_s = np.arange(int(20 * RATES[camera.name])) / RATES[camera.name]
        views = [
            seen_board(camera, BOARD, path(moment), 0.1, rng)
            for moment in time_s + BEGIN_S[camera.name]
        ]
        moved = replace(camera, translation=camera.translation + 1.0)
        signals.append(board_speed(BOARD, moved, time_s, views))
    result = offsets_from_signals(signals, SignalSettings(3.0))
    true = [BEGIN_S["cam_0"] - begin for begin in BEGIN_S.values()]
    np.testing.assert_allclose([line.offset_s for line in result.offsets], true, atol=0.005)
    assert result.agreed
    unseen = board_speed(BOARD, walk.cameras[0], np.arange(5) / 5, [None] * 5)
    assert len(unseen.time_s) == 0


def test_frames_around_a_time():
    times = np.array([0.0, 0.1, 0.2, 0.6])
    moments = np.array([-0.05, 0.1, 0.1501, 0.19995, 0.4, 0.6, 0.7])
    before, after, part = frames_around(times, moments)
    assert before.tolist() == [-1, 1, 1, 2, -1, 3, -1]
    assert after.tolist() == [-1, 1, 2, 2, -1, 3, -1]
    np.testing.assert_allclose(part[[1, 2, 3]], [0, 0.501, 0], atol=1e-9)
    before, after, _ = frames_around(np.zeros(1), np.array([0.0, 1.0]))
    assert before.tolist() == after.tolist() == [0, -1]


def test_a_view_between_two():
    pixels = BOARD.points_m[:, :2] * 100
    before = BoardView(np.arange(40), pixels, (480, 360))
    after = BoardView(np.arange(2, 40), pixels[2:] + np.array([4.0, 8.0]), (480, 360))
    view = view_between(BOARD, before, after, 0.25)
    assert view is not None and view.ids.tolist() == list(range(2, 40))
    np.testing.assert_allclose(view.pixels, pixels[2:] + np.array([1.0, 2.0]))
    symmetric = Board(8, 6, 0.15)
    pixels = symmetric.points_m[:, :2] * 100
    before = BoardView(np.arange(48), pixels, (480, 360))
    after = BoardView(np.arange(48), pixels[::-1] + np.array([4.0, 0.0]), (480, 360))
    view = view_between(symmetric, before, after, 0.5)
    assert view is not None
    np.testing.assert_allclose(view.pixels, pixels + np.array([2.0, 0.0]))
    few = BoardView(np.arange(5), pixels[:5], (480, 360))
    assert view_between(symmetric, before, few, 0.5) is None


@pytest.fixture(scope="module")
def board_walk(walk, tmp_path_factory) -> Path:
    """A board that is carried before cameras out of step, and the lenses."""
    folder, path = tmp_path_factory.mktemp("walk"), carried(walk, 12, 5)
    for index, camera in enumerate(walk):
        film, fps = BoardCamera(camera, BOARD, index), RATES[camera.name]
        moments_s = BEGIN_S[camera.name] + np.arange(int(8 * fps)) / fps
        pictures = (film.picture(path(moment_s)) for moment_s in moments_s)
        write_film(folder / f"{camera.name}.avi", pictures, fps)
    write_rig(without_poses(walk), folder.parent / "lenses.toml")
    return folder


@pytest.mark.slow
def test_a_board_out_of_step_calibrates(board_walk, walk, tmp_path, capsys):
    lenses = board_walk.parent / "lenses.toml"
    rig_path, out = tmp_path / "rig.toml", board_walk / "timestamps.csv"
    like_this = ["--board", "8x5", "--intrinsics", str(lenses)]
    extrinsics = ["calibrate", "extrinsics", str(board_walk), *like_this, "--square", "0.15"]
    extrinsics += ["--out", str(rig_path)]
    assert "--by board --out" in told(capsys, *extrinsics)
    sync = ["calibrate", "sync", str(board_walk), "--by", "board", *like_this, "--most", "2"]
    assert run([*sync, "--out", str(out)]) == 0
    found = first_times(out)
    for name, begin in BEGIN_S.items():
        assert found[name] - found["cam_1"] == pytest.approx(begin, abs=0.012)
    assert run(extrinsics) == 0
    aligned = align_rigs(read_rig(rig_path), walk)
    for camera in walk:
        millimetres, degrees = pose_difference(aligned[camera.name], camera)
        assert millimetres < 15 and degrees < 0.3
    capsys.readouterr()
    again = [*extrinsics, "--floor", "900", "--overwrite"]
    assert "--floor 900 is not in cam_0" in told(capsys, *again)
