"""Files that are sent to the studio: whole and in their place, or not there."""

import shutil
import socket
from pathlib import Path
from urllib.parse import quote

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import ring, write_recording
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import opened_studio, send
from voxelpose.recording.folder import Recording
from voxelpose.studio.projects import StudioFolder
from voxelpose.studio.uploads import LARGEST_UPLOAD


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A recording by two cameras, elsewhere."""
    return write_recording(tmp_path_factory.mktemp("made") / "walk", ring(2))


@pytest.fixture
def studio(tmp_path):
    (tmp_path / "root" / "walk").mkdir(parents=True)
    with opened_studio(tmp_path / "root") as server:
        yield server


@pytest.fixture
def walk(tmp_path) -> Path:
    return tmp_path / "root" / "walk"


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_files_come_to_their_places_and_the_reader_speaks(studio, walk, made):
    def said() -> dict:
        return ask(studio, "/api/project?project=walk")[1]

    assert "holds no video" in said()["fault"]
    for name in ("cam_1.mp4", "cam_2.mp4"):
        assert send(studio, "video", name, (made / name).read_bytes())[0] == 200
    with pytest.raises(InputError) as error:
        Recording.open(walk)
    assert said()["fault"] == str(error.value)
    assert (
        send(studio, "calibration", "rig.toml", (made / "calibration.toml").read_bytes())[0] == 200
    )
    _, picture = cv2.imencode(".png", np.full((120, 160, 3), 90, np.uint8))
    assert send(studio, "background", "cam_1.png", picture.tobytes())[0] == 200
    assert send(studio, "subject.toml", "anna.toml", b"stature = 1.7\n")[0] == 200
    expected = ["background", "background/cam_1.png", "calibration.toml", "cam_1.mp4", "cam_2.mp4"]
    assert names(walk) == sorted([*expected, "subject.toml"])
    known = said()
    assert (known["fault"], known["frames"], known["command"]) == ("", 6, "fit")
    assert [camera["empty"] for camera in known["cameras"]] == [True, False]
    assert {file["name"] for file in known["files"]} == set(names(walk)) - {"background"}
    assert ask(studio, "/api/remove", {"project": "walk", "name": "background/cam_1.png"})[0] == 200
    assert not (walk / "background" / "cam_1.png").exists()
    for name in ("background", "../walk/cam_1.mp4", "voxelpose.toml"):
        assert ask(studio, "/api/remove", {"project": "walk", "name": name})[0] == 400


@pytest.mark.parametrize(
    ("place", "name", "content", "line"),
    [
        ("video", "cam_1.txt", b"x", "convert it first"),
        ("video", "cam_1.mp4", b"#EXTM3U\nfile:///etc/hosts\n", "is text, no video"),
        ("video", "cam_1.mp4", b"\0" * 5000, "cam_1.mp4"),
        ("video", "../cam_1.mp4", b"\0", "cannot be a name"),
        ("video", "a/b.mp4", b"\0", "cannot be a name"),
        ("video", ".hidden.mp4", b"\0", "cannot be a name"),
        ("video", "con.mp4", b"\0", "cannot be a name"),
        ("video", "cam\u202e4pm.mp4", b"\0", r"'cam\u202e4pm.mp4' cannot be a name"),
        ("background", "..", b"\0", "cannot be a name"),
        ("calibration", "rig.mp4", b"\0", "convert it first"),
        ("subject.toml", "x.toml", b"body = '../../../etc/passwd'\n", "names a body's file"),
        ("subject.toml", "x.toml", b"stature = 99\n", "x.toml: stature = 99 is impossible"),
        ("voxelpose.toml", "x.toml", b"[fit]\n", "not understood"),
    ],
)
def test_what_is_no_such_file_is_refused_in_a_line(studio, walk, place, name, content, line):
    status, answer = send(studio, place, quote(name, safe=""), content)
    assert status == 400 and line in answer["error"] and "\n" not in answer["error"]
    assert "partial" not in answer["error"]
    assert [name for name in names(walk) if name != "background"] == []


def picture(value: int = 90) -> bytes:
    return cv2.imencode(".png", np.full((120, 160, 3), value, np.uint8))[1].tobytes()


def test_folders_of_pictures_come_to_their_cameras(studio, walk):
    for place in ("video", "masks", "background", "boards", "board_walk"):
        for number in range(3):
            name = f"{number:04d}.png&camera=cam_1"
            assert send(studio, place, name, picture(number))[0] == 200
    recording = Recording.open(walk, cameras=["cam_1"], fps=25)
    assert recording.frame_count == 3 and len(recording.backgrounds()["cam_1"].stills) == 3
    known = ask(studio, "/api/project?project=walk")[1]
    assert {(file["place"], file["name"], file["pictures"]) for file in known["files"]} == {
        ("video", "cam_1", 3),
        *((place, f"{place}/cam_1", 3) for place in ("background", "masks", "boards")),
        ("board_walk", "board_walk/cam_1", 3),
    }
    assert [one["name"] for one in ask(studio, "/api/state")[1]["projects"]] == ["walk"]
    (walk / "cam_1" / "notes.txt").write_text("mine")
    for name in ("cam_1", "masks/cam_1"):
        assert ask(studio, "/api/remove", {"project": "walk", "name": name})[0] == 200
    assert names(walk / "cam_1") == ["notes.txt"] and not (walk / "masks" / "cam_1").exists()


@pytest.mark.parametrize(
    ("place", "name", "line"),
    [
        ("video", "0.png", "convert it first"),
        ("boards", "0.png", "convert it first"),
        ("video", "0.mp4&camera=cam_1", "convert it first"),
        ("calibration", "0.png&camera=cam_1", "convert it first"),
        ("video", "0.png&camera=Background", "no camera can be called Background"),
        ("video", "0.png&camera=..", "cannot be a name"),
        ("masks", "0.png&camera=a/b", "cannot be a name"),
        ("video", "0.png&camera=cam_2", "cam_2.mp4 is there for camera cam_2"),
        ("video", "cam_3.mp4", "cam_3/ is there for camera cam_3"),
        ("boards", "0.jpg&camera=cam_9", "cannot be read as an image"),
    ],
)
def test_pictures_that_fit_nowhere_are_refused(studio, walk, place, name, line):
    (walk / "cam_2.mp4").write_bytes(b"x")
    (walk / "cam_3").mkdir()
    (walk / "cam_3" / "0.png").write_bytes(picture())
    before = names(walk)
    content = b"no picture" if name.startswith("0.jpg") else picture()
    status, answer = send(studio, place, name, content)
    assert status == 400 and line in answer["error"]
    assert [one for one in names(walk) if one != "boards"] == before


def test_a_calibration_is_taken_over_from_another_project(studio, walk, made):
    room = walk.parent / "room"
    room.mkdir()
    asked = {"project": "walk", "of": "room"}
    status, answer = ask(studio, "/api/calibration", asked)
    assert status == 400 and "room has no calibration in a file" in answer["error"]
    (room / "calibration.toml").write_bytes((made / "calibration.toml").read_bytes())
    assert ask(studio, "/api/calibration", asked)[0] == 200
    assert (walk / "calibration.toml").read_bytes() == (made / "calibration.toml").read_bytes()
    status, answer = ask(studio, "/api/calibration", asked)
    assert status == 400 and "calibration.toml is there: remove it first" in answer["error"]
    for of in ("..", "../made", "nobody"):
        assert ask(studio, "/api/calibration", asked | {"of": of})[0] == 400


def test_sizes_are_refused_before_anything_is_sent(studio, walk, monkeypatch):
    def told(place: str, name: str, count: int) -> tuple:
        asked = {"project": "walk", "place": place, "name": name, "bytes": count}
        return ask(studio, "/api/accepts", asked)

    assert told("video", "cam_1.mp4", 1)[0] == 200
    for place, name, count in (
        ("calibration", "rig.toml", 10_000_001),
        ("video", "cam_1.mp4", 0),
        ("video", "cam_1.mp4", LARGEST_UPLOAD + 1),
    ):
        status, answer = told(place, name, count)
        assert status == 400 and "are taken" in answer["error"]
    full = shutil.disk_usage(walk)._replace(free=2**30)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: full)
    assert "the disk is full" in told("video", "cam_1.mp4", 1)[1]["error"]


def test_a_second_file_of_a_camera_is_refused(studio, walk, made):
    (walk / "cam_1.avi").write_bytes(b"x")
    (walk / "calibration.yml").write_bytes(b"x")
    for place, name in (("video", "cam_1.mp4"), ("calibration", "calibration.toml")):
        status, answer = send(studio, place, name, (made / name).read_bytes())
        assert status == 400 and "remove it first" in answer["error"]
    assert names(walk) == ["calibration.yml", "cam_1.avi"]


def test_what_is_cut_off_leaves_nothing(studio, walk, made):
    content = (made / "cam_1.mp4").read_bytes()
    link = socket.create_connection(("127.0.0.1", studio.port), timeout=10)
    head = (
        "POST /upload?project=walk&place=video&name=cam_1.mp4 HTTP/1.1\r\n"
        f"Host: 127.0.0.1:{studio.port}\r\nContent-Type: application/octet-stream\r\n"
        f"Content-Length: {len(content)}\r\n\r\n"
    )
    link.sendall(head.encode() + content[:-1])
    link.shutdown(socket.SHUT_WR)
    assert link.recv(1000) == b""
    link.close()
    assert names(walk) == []


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "http://evil.example"}, 403),
        ({"Host": "evil.example:80"}, 403),
        ({"Transfer_Encoding": "chunked"}, 400),
        ({"Content_Length": str(LARGEST_UPLOAD + 1)}, 413),
        ({"Content_Length": "-1"}, 400),
    ],
)
def test_foreign_and_endless_files_are_refused_before_they_are_read(
    studio, walk, made, headers, status
):
    content = (made / "cam_1.mp4").read_bytes()
    assert send(studio, "video", "cam_1.mp4", content, **headers)[0] == status
    assert ask(studio, "/api/new", content, Content_Type="application/octet-stream")[0] == 400
    assert names(walk) == []


def test_links_that_lead_out_are_not_followed(studio, walk, made, tmp_path):
    """Neither folders nor files, by any answer; those within are."""
    away, secret = tmp_path / "away", tmp_path / "secret"
    away.mkdir()
    secret.write_text("root:")
    (tmp_path / "root" / "linked").symlink_to(made)
    (walk / "loop").symlink_to("loop")
    (walk / "cam_1.mp4").symlink_to(walk.parent / "cam_1.mp4")
    content = (made / "cam_1.mp4").read_bytes()
    (walk.parent / "cam_1.mp4").write_bytes(content)
    assert ask(studio, "/api/project?project=walk")[0] == 200
    for link, target in (("background", away), ("board.pdf", secret), ("boards/a.png", secret)):
        (walk / link).parent.mkdir(exist_ok=True)
        (walk / link).symlink_to(target)
        status, answer = send(studio, "background", "cam_1.mp4", content)
        assert status == 400 and f"'walk/{link}' lies outside of" in answer["error"]
        for path in (
            *("/api/project?project=walk", "/sheet/board?project=walk", "/rig?project=walk"),
            *(
                "/still?project=walk&place=boards&camera=a",
                "/check/walk/",
                "/api/live?project=walk",
            ),
            "/api/form?project=linked&command=fit",
        ):
            status, answer = ask(studio, path)
            assert status == 400 and "lies outside of" in answer["error"], path
        (walk / link).unlink()
    assert not names(away)
    assert [one["name"] for one in ask(studio, "/api/state")[1]["projects"]] == ["walk"]


def test_a_recording_or_a_result_is_no_studio(made, tmp_path):
    with pytest.raises(InputError, match="is itself a recording: give the folder"):
        StudioFolder(made)
    with pytest.raises(InputError, match="there is no folder"):
        StudioFolder(tmp_path / "nowhere")
