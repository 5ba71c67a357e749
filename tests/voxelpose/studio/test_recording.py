"""Cameras recorded in the studio: videos that are played as if filmed stand for them."""

import http.server
import threading
import time

import cv2
import numpy as np
import pytest

from benchmarks.board_scene import board_picture
from calib.board import Board
from calib.errors import InputError
from calib.files import write_rig
from tests.clips import waving
from tests.sources import ring, write_film, write_staged
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import ended, opened_studio, until
from voxelpose.cli.options import folder_settings
from voxelpose.recording.folder import Recording
from voxelpose.studio.recording_job import put_in_place

CAMERAS = [{"name": f"cam_{n}", "address": f"films/cam_{n}.mkv"} for n in (1, 2)]


@pytest.fixture
def walk(tmp_path):
    """A project without files, beside videos of two cameras."""
    write_staged(tmp_path / "root" / "films", waving(12), ring(2, (160, 120)))
    (tmp_path / "root" / "walk").mkdir()
    return tmp_path / "root" / "walk"


@pytest.fixture
def studio(walk):
    with opened_studio(walk.parent) as server:
        yield server


def start(server, **more) -> tuple:
    usual = {"project": "walk", "sources": CAMERAS, "countdown": 0, "empty": 0.3}
    return ask(server, "/api/record", usual | more)


def ready(state: dict) -> bool:
    return all(camera["pictures"] for camera in state.get("cameras", ())) and "phase" in state


def record(server, moments: int = 20, **more) -> dict:
    """Records so many moments; the state at the end."""
    assert start(server, **more)[0] == 200
    until(server, ready)
    assert ask(server, "/api/ask", {"word": "record"})[0] == 200
    until(server, lambda state: state.get("moments", 0) >= moments)
    assert ask(server, "/api/ask", {"word": "finish"})[0] == 200
    return ended(server)


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_cameras_are_shown_then_recorded_with_their_empty_view(studio, walk):
    known = ask(studio, "/api/cameras?project=walk")[1]
    assert known["videos"] == ["films/cam_1.mkv", "films/cam_2.mkv"] and known["sources"] == []
    assert start(studio)[0] == 200
    state = until(studio, ready)
    assert state["phase"] == "preview"
    assert state["cameras"][0] | {"pictures": 1} == {
        **{"name": "cam_1", "state": "ok", "pictures": 1},
        "size": (160, 120),
    }
    status, picture = ask(studio, "/preview?camera=cam_1")
    assert status == 200
    assert cv2.imdecode(np.frombuffer(picture, np.uint8), 1).shape == (120, 160, 3)
    assert ask(studio, "/preview?camera=cam_9")[0] == 400
    assert not names(walk)[:-1]  # voxelpose.toml alone
    ask(studio, "/api/stop", {})
    assert ended(studio)["state"] == "stopped" and names(walk) == ["voxelpose.toml"]
    state = record(studio, empty=0.001)  # shorter than a picture
    assert state["state"] == "done" and state["moments"] >= 20, state
    write_rig(ring(2, (160, 120)), walk / "calibration.toml")
    recording = Recording.open(walk)
    assert recording.frame_count == state["moments"]
    assert recording.fps == pytest.approx(25, rel=0.2)  # the films' own rate
    empty = recording.backgrounds()
    assert sorted(empty) == ["cam_1", "cam_2"] and all(len(one.stills) for one in empty.values())
    expected = ["background", "calibration.toml", "cam_1", "cam_2", "timestamps.csv"]
    assert names(walk) == [*expected, "voxelpose.toml"]
    again(studio, walk, recording.frame_count)


def again(studio, walk, before: int) -> None:
    """A second time only where that is wanted, with the cameras of the first."""
    status, answer = start(studio)
    assert status == 400 and "cam_1, cam_2 are there already: make a new project" in answer["error"]
    assert ask(studio, "/api/cameras?project=walk")[1]["sources"] == CAMERAS
    found = folder_settings("live", walk)
    assert [text.partition("=")[0] for text in found["source"].value] == ["cam_1", "cam_2"]
    state = record(studio, 5, replace=True, sources=CAMERAS[:1], empty=0, what="take")
    assert state["moments"] < before and names(walk / "background") == ["cam_1", "cam_2"]
    assert Recording.open(walk, cameras=["cam_1"]).frame_count == state["moments"]
    assert not (walk / "cam_2").exists() and not (walk / ".replaced").exists()


@pytest.mark.slow
def test_it_ends_by_itself_with_the_videos_or_after_its_time(studio, walk):
    assert start(studio, length=0.4)[0] == 200
    until(studio, ready)
    ask(studio, "/api/ask", {"word": "record"})
    state = ended(studio)
    assert state["state"] == "done" and 0.2 < state["seconds"] < 0.6
    assert start(studio, what="board_walk", loop=False)[0] == 200
    until(studio, ready)
    time.sleep(1)  # the videos end before it is pressed
    ask(studio, "/api/ask", {"word": "record"})
    state = ended(studio)
    assert (state["state"], state["step"]) == ("failed", "record")
    assert "at no moment did all cameras send a picture" in state["error"]
    assert names(walk / "board_walk") == []


@pytest.mark.slow
@pytest.mark.parametrize("older", [False, True])
def test_where_a_board_was_seen_is_told_meanwhile(studio, walk, older):
    film, settings = walk.parent / "films" / "board.avi", '[calibrate.intrinsics]\nboard = "8x5"\n'
    printed = board_picture(Board(8, 5, 0.15), 40)
    if older:  # a print of OpenCV before 4.6
        printed = Board(8, 5, 0.15, 0.1, legacy=True).charuco.generateImage((450, 300))
        settings += "marker = 0.1\n"
    picture = cv2.copyMakeBorder(printed, 30, 30, 15, 15, cv2.BORDER_CONSTANT, value=255)
    write_film(film, [cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)] * 60)
    (walk / "voxelpose.toml").write_text(f"{settings}square = 0.15\n")
    sources = [{"name": "cam_1", "address": "films/board.avi"}]
    assert start(studio, sources=sources, what="boards")[0] == 200
    until(studio, ready)
    assert ask(studio, "/api/ask", {"word": "record"})[0] == 200
    state = until(studio, lambda state: state["moments"] >= 3 and np.any(cells(state)))
    assert state["cameras"][0]["corners_per_cell"] and np.shape(cells(state)) == (8, 8)
    ask(studio, "/api/ask", {"word": "finish"})
    assert ended(studio)["state"] == "done"
    assert len(list((walk / "boards" / "cam_1").glob("*.jpg"))) >= 3


def cells(state: dict) -> list:
    return state["cameras"][0].get("corners_per_cell", [])


@pytest.mark.parametrize(
    ("source", "line"),
    [
        ({"address": "/etc/passwd"}, "nor a video in the studio's folder"),
        ({"address": "../away.mkv"}, "nor a video in the studio's folder"),
        ({"address": "linked.mkv"}, "nor a video in the studio's folder"),
        ({"address": "file:///etc/passwd"}, "nor a video in the studio's folder"),
        ({"address": "concat:films/cam_1.mkv"}, "nor a video in the studio's folder"),
        ({"address": "films/calibration.toml"}, "is no video"),
        ({"address": "123"}, "webcams have numbers from 0 to 99"),
        ({"address": "http://a\tb"}, "an address has no spaces"),
        ({"name": "../x"}, "cannot be a name"),
        ({"name": "Boards"}, "no camera can be called Boards"),
        ({"name": "a=b"}, "no camera can be called a=b"),
        ({"name": "CAM_2"}, "two cameras have one name"),
        ({"address": "films/cam_2.mkv"}, "two cameras have one address"),
    ],
)
def test_nothing_but_cameras_and_own_videos_is_opened(studio, walk, tmp_path, source, line):
    (tmp_path / "away.mkv").write_bytes((walk.parent / "films" / "cam_1.mkv").read_bytes())
    (walk.parent / "linked.mkv").symlink_to(tmp_path / "away.mkv")
    sources = [CAMERAS[0] | source, CAMERAS[1]]
    status, answer = start(studio, sources=sources)
    assert status == 400 and line in answer["error"]
    assert studio._session.job.status() == {"state": "idle"} and names(walk) == []


@pytest.mark.slow
def test_a_camera_that_is_not_there_is_named(studio, walk):
    class Nothing(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_error(404)

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Nothing) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/video"
        sources = [CAMERAS[0], {"name": "cam_2", "address": address}]
        assert start(studio, sources=sources)[0] == 200
        until(studio, lambda state: "phase" in state and state["cameras"][0]["pictures"] > 0)
        state = until(studio, lambda state: "trying again" in state["cameras"][1]["state"])
        assert state["cameras"][1]["size"] is None
        ask(studio, "/api/ask", {"word": "record"})
        state = ended(studio)
        server.shutdown()
    assert state["state"] == "failed" and "no picture of cam_2: correct" in state["error"]


def test_what_cannot_be_moved_is_an_error_of_the_user(tmp_path):
    (tmp_path / "staged" / "cam_1").mkdir(parents=True)
    (tmp_path / "staged" / "cam_1" / "0.jpg").write_bytes(b"x")
    with pytest.raises(InputError, match="cannot be written"):  # there are no times
        put_in_place(tmp_path / "staged", tmp_path / "target")
