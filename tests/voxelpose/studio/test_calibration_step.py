"""Calibration in the studio: what is typed into its forms is what the commands do."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.board_scene import room, without_poses
from calib.board import Board
from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig, write_rig
from tests.sources import write_film
from tests.voxelpose.board_films import film_boards
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import ended, opened_studio, send
from tests.voxelpose.studio.test_studio_server import fetched
from voxelpose.cli.options import folder_settings, load_command, options_of
from voxelpose.studio.command_forms import filled_in
from voxelpose.studio.projects import StudioFolder

BOARD = Board(8, 5, 0.15)
LIKE_THIS = {"board": "8x5", "square": 0.15}


@pytest.fixture(scope="module")
def truth() -> Rig:
    return room(3, 2.4, size=(480, 360), arc_deg=80)


@pytest.fixture(scope="module")
def filmed(truth, tmp_path_factory):
    return film_boards(tmp_path_factory.mktemp("filmed"), truth, BOARD, np.array([-0.4, -0.3, 0]))


@pytest.fixture
def walk(tmp_path):
    (tmp_path / "root" / "walk").mkdir(parents=True)
    return tmp_path / "root" / "walk"


@pytest.fixture
def studio(walk):
    with opened_studio(walk.parent) as server:
        yield server


def start(server, command: str, of: str = "boards", **settings) -> tuple:
    asked = {"project": "walk", "command": command, "of": of, "settings": settings}
    return ask(server, "/api/calibrate", asked)


def state(server) -> dict:
    return ask(server, "/api/calibration?project=walk")[1]


def test_the_board_is_made_and_what_it_looks_like_is_kept(studio, walk):
    assert ask(studio, "/sheet/board?project=walk")[0] == 400
    asked = {"project": "walk", "settings": {"board": "7x4", "paper": "a3"}}
    status, made = ask(studio, "/api/board", asked)
    assert status == 200 and made["squares"] == [8, 5] and made["page_mm"] == [420, 297]
    assert fetched(studio, "/sheet/board?project=walk").startswith(b"%PDF")
    for command in ("intrinsics", "extrinsics"):
        found = folder_settings(f"calibrate.{command}", walk)
        assert {name: setting.value for name, setting in found.items()} == {
            "board": "7x4",
            "square": made["square"],
        }
    rows = {row["name"]: row for row in state(studio)["forms"]["intrinsics"]}
    assert rows["board"]["value"] == "7x4" and state(studio)["sheet"]
    assert not folder_settings("calibrate.sync", walk)
    large = asked | {"settings": {"square": 0.2, "paper": "a4", "board": "7x4"}}
    status, answer = ask(studio, "/api/board", large)
    assert status == 400 and "do not fit on A4" in answer["error"]


def test_the_forms_are_the_commands_own(studio):
    hidden = {"out", "overwrite", "intrinsics", "points"}
    for command, rows in state(studio)["forms"].items():
        expected = options_of(load_command(f"calibrate.{command}")).keys() - hidden
        assert {row["name"] for row in rows} == expected
        assert all(row["help"] for row in rows)


@pytest.mark.parametrize(
    ("command", "of", "settings", "line"),
    [
        ("intrinsics", "boards", LIKE_THIS, "there are no pictures of the board"),
        ("extrinsics", "boards", LIKE_THIS, "there are no videos of the carried board"),
        ("extrinsics", "points", {}, "the lenses are not known"),
        ("extrinsics", "take", {}, "cannot be made of the take"),
        ("intrinsics", "boards", {"out": "../x.toml"}, "the page has no setting 'out'"),
        ("extrinsics", "boards", {"intrinsics": "/etc/passwd"}, "no setting 'intrinsics'"),
        ("extrinsics", "boards", {"points": "../points.csv"}, "the page has no setting 'points'"),
    ],
)
def test_what_must_be_done_before_is_said_in_a_line(
    studio, walk, filmed, command, of, settings, line
):
    if any(name in settings for name in ("out", "intrinsics", "points")):
        shutil.copytree(filmed / "stills", walk / "boards")
        shutil.copytree(filmed / "walk", walk / "board_walk")
        (walk / "lenses.toml").write_text("")
    status, answer = start(studio, command, of, **settings)
    assert status == 400 and line in answer["error"] and "\n" not in answer["error"]
    assert not (walk / "voxelpose.toml").exists()
    assert studio._session.job.status() == {"state": "idle"}


def test_a_setting_that_must_be_known_is_asked_for(walk):
    fixed = {"pictures": (walk,), "out": walk / "lenses.toml"}
    with pytest.raises(InputError, match="--square must be known: fill that in"):
        filled_in("calibrate.intrinsics", StudioFolder(walk.parent), walk, fixed, {"board": "8x5"})


@pytest.mark.slow
def test_from_sent_pictures_to_a_calibration_and_again(studio, walk, filmed, truth):
    for still in sorted((filmed / "stills").rglob("*.png")):
        path = f"boards/{still.parent.name}/{still.name}"
        assert send(studio, path, still.read_bytes())[0] == 200
    for film in sorted((filmed / "walk").iterdir()):
        assert send(studio, f"board_walk/{film.name}", film.read_bytes())[0] == 200
    known = {file["name"]: file["pictures"] for file in state(studio)["files"]}
    assert known["boards/cam_1"] == 12 and known["board_walk/cam_1.avi"] is None
    still = fetched(studio, "/still?project=walk&name=boards/cam_1")
    assert cv2.imdecode(np.frombuffer(still, np.uint8), 1).shape == (360, 480, 3)
    assert start(studio, "intrinsics", **LIKE_THIS)[0] == 200
    status, answer = start(studio, "sync")
    assert status == 400 and "the lens calibration of walk is still running" in answer["error"]
    assert ended(studio)["state"] == "done"
    lenses = state(studio)["lenses"]
    assert lenses["cam_1"]["rms_px"] < 0.3 and lenses["cam_1"]["before_rms_px"] is None
    assert np.shape(lenses["cam_1"]["corners_per_cell"]) == (8, 8)
    assert start(studio, "extrinsics", floor=0, **LIKE_THIS)[0] == 200
    assert ended(studio)["state"] == "done"
    rig = state(studio)["rig"]
    assert rig["rms_px"] < 0.5 and rig["cameras"]["cam_1"]["before_rms_px"] is None
    assert fetched(studio, "/rig?project=walk").startswith(b"\x89PNG")
    assert read_rig(walk / "calibration.toml").names == truth.names
    saved = folder_settings("calibrate.extrinsics", walk)
    assert {name: one.value for name, one in saved.items()} == LIKE_THIS | {"floor": 0}
    worse(studio, walk)


def worse(studio, walk) -> None:
    """A camera that was moved is seen in the errors before."""
    rig = read_rig(walk / "calibration.toml")
    first, second, third = rig
    moved = second.center_m + np.array([0.0, 0.0, 0.3])
    second = replace(second, translation=-second.rotation @ moved)
    write_rig(Rig((first, second, third)), walk / "calibration.toml")
    assert start(studio, "extrinsics")[0] == 200  # as it was typed in before
    assert ended(studio)["state"] == "done"
    lines = state(studio)["rig"]["cameras"]
    assert lines["cam_1"]["before_rms_px"] > 3 > 10 * lines["cam_1"]["rms_px"]


def test_a_take_is_put_in_step_without_the_board_of_the_files(studio, walk, monkeypatch):
    for number in (1, 2):
        (walk / f"cam_{number}.mp4").write_bytes(b"x")
        (walk / "board_walk").mkdir(exist_ok=True)
        (walk / "board_walk" / f"cam_{number}.mp4").write_bytes(b"x")
    (walk / "voxelpose.toml").write_text('[calibrate.sync]\nboard = "8x5"\n')
    started = []
    monkeypatch.setattr(studio._session.job, "start", lambda *given, **more: started.append(given))
    assert start(studio, "sync", "take", by="sound", seconds=9)[0] == 200
    assert start(studio, "sync", "boards", by="board")[0] == 200
    (kind, of, _, take), (other, _, _, board) = started
    assert (kind, of, other) == ("synchronisation", "walk", "board synchronisation")
    assert (take.recording, take.out) == (walk, walk / "timestamps.csv")
    assert (take.board, take.by, take.seconds, take.intrinsics) == (None, "sound", 9.0, None)
    assert board.board == "8x5" and board.out == walk / "board_walk" / "timestamps.csv"


@pytest.mark.slow
def test_a_failure_is_told_where_it_can_be_mended(studio, walk, truth):
    (walk / "board_walk").mkdir()
    for name in truth.names:
        empty = np.full((360, 480, 3), 90, np.uint8)
        write_film(walk / "board_walk" / f"{name}.avi", [empty] * 3)
    write_rig(without_poses(truth), walk / "lenses.toml")
    assert start(studio, "extrinsics", **LIKE_THIS)[0] == 200
    failed = ended(studio)
    assert (failed["state"], failed["step"]) == ("failed", "calibrate")
    assert "never saw the board" in failed["error"]
    assert not (walk / "calibration.toml").exists()
    (walk / "calibration.yml").write_text("x")
    status, answer = start(studio, "extrinsics", **LIKE_THIS)
    assert status == 400 and "calibration.yml is there: remove it in Import" in answer["error"]


@pytest.mark.parametrize(
    "name", ["boards/cam_0", "../boards/cam_0", "..", "", "boards/cam_0/0.png"]
)
def test_no_picture_outside_is_shown(studio, walk, filmed, name):
    away = walk.parent.parent / "away"
    shutil.copytree(filmed / "stills" / "cam_0", away)
    (walk / "boards").mkdir()
    (walk / "boards" / "cam_0").symlink_to(away)
    status, answer = ask(studio, f"/still?project=walk&name={name}")
    assert status == 400 and answer["error"]
