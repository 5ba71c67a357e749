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
from tests.voxelpose.studio.studio_scenes import opened_studio, plan, send
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
        assert send(studio, name, (made / name).read_bytes())[0] == 200
    with pytest.raises(InputError, match="holds no calibration"):
        Recording.open(walk)
    assert "holds no calibration" in said()["fault"]
    calibration = (made / "calibration.toml").read_bytes()
    assert send(studio, "calibration.toml", calibration)[0] == 200
    _, picture = cv2.imencode(".png", np.full((120, 160, 3), 90, np.uint8))
    assert send(studio, "background/cam_1.png", picture.tobytes())[0] == 200
    assert send(studio, "subject.toml", b"stature = 1.7\n")[0] == 200
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
    ("path", "content", "line"),
    [
        ("cam_1.txt", b"x", "convert it first"),
        ("cam_1.mp4", b"#EXTM3U\nfile:///etc/hosts\n", "is text, no video"),
        ("cam_1.mp4", b"\0" * 5000, "cam_1.mp4"),
        ("../cam_1.mp4", b"\0", "cannot be a name"),
        ("/cam_1.mp4", b"\0", "cannot be a name"),
        ("a/b/c.mp4", b"\0", "convert it first"),
        (".hidden.mp4", b"\0", "cannot be a name"),
        ("con.mp4", b"\0", "cannot be a name"),
        ("cam\u202e4pm.mp4", b"\0", r"'cam\u202e4pm.mp4' cannot be a name"),
        ("background/..", b"\0", "cannot be a name"),
        ("background.mp4", b"\0", "no camera can be called background"),
        ("calibration.mp4", b"\0", "no camera can be called calibration"),
        ("subject.toml", b"body = '../../../etc/passwd'\n", "names a body's file"),
        ("subject.toml", b"stature = 99\n", "subject.toml: stature = 99 is impossible"),
        ("voxelpose.toml", b"[fit]\n", "convert it first"),
    ],
)
def test_what_is_no_such_file_is_refused_in_a_line(studio, walk, path, content, line):
    status, answer = send(studio, quote(path, safe=""), content)
    assert status == 400 and line in answer["error"] and "\n" not in answer["error"]
    assert "partial" not in answer["error"]
    assert names(walk) == [] and walk.is_dir()


def picture(value: int = 90) -> bytes:
    return cv2.imencode(".png", np.full((120, 160, 3), value, np.uint8))[1].tobytes()


def test_folders_of_pictures_come_to_their_cameras(studio, walk):
    for place in ("", "masks/", "background/", "boards/", "board_walk/"):
        for number in range(3):
            path = f"{place}cam_1/{number:04d}.png"
            assert send(studio, path, picture(number))[0] == 200
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
    ("path", "line"),
    [
        ("0.png", "convert it first"),
        ("boards/0.png", "convert it first"),
        ("calibration/0.png", "no camera can be called calibration"),
        ("Background/0.png", "no camera can be called Background"),
        ("cam_2/0.png", "cam_2.mp4 is there: add cam_2/0.png again, or remove it first"),
        ("cam_3.mp4", "cam_3 is there"),
        ("cam_3/0.png", "0.png is there"),
        ("boards/cam_9/0.jpg", "cannot be read as an image"),
    ],
)
def test_pictures_that_fit_nowhere_are_refused(studio, walk, path, line):
    (walk / "cam_2.mp4").write_bytes(b"x")
    (walk / "cam_3").mkdir()
    (walk / "cam_3" / "0.png").write_bytes(picture())
    before = names(walk)
    status, answer = send(studio, path, b"no picture" if path.endswith("jpg") else picture())
    assert status == 400 and line in answer["error"]
    assert [one for one in names(walk) if one != "boards"] == before


def test_files_of_a_folder_keep_their_places(studio, walk):
    """A whole recording: an empty view can never take the place of the take."""
    paths = [f"{folder}cam_{n}.mp4" for folder in ("", "background/", "boards/") for n in (1, 2)]
    paths += ["masks/cam_1/0.png", "calibration.toml", "subject.toml", "regions/cam_1.png"]
    given = [f"day/{path}" for path in paths]
    given += ["day/old_calib.toml", "day/notes.txt", "day/out/summary.json", "day/out/overlay.webm"]
    for chosen in ("", "video", "background", "calibration"):
        status, known = plan(studio, *given, chosen=chosen)
        (take,) = known["takes"]
        assert status == 200 and take["conflicts"] == []
        assert (take["project"], take["new"]) == ("walk", False)
        assert {path: given[number] for number, path, _ in take["files"]} == {
            path: f"day/{path}" for path in paths
        }
        assert [line.partition(":")[0] for line in known["refused"]] == [
            *("day/out/summary.json", "day/out/overlay.webm", "day/notes.txt"),
            "day/old_calib.toml",
        ]


@pytest.mark.parametrize(
    ("given", "chosen", "expected"),
    [
        ("empty/cam_1.mp4", "background", "background/cam_1.mp4"),
        ("sam/cam_1/0.png", "masks", "masks/cam_1/0.png"),
        ("day/cam_1/video.mp4", "", "cam_1.mp4"),
        ("day/left/GX010001.MP4", "", "left/GX010001.MP4"),
        ("day/Background/cam_1.png", "", "background/cam_1.png"),
        ("day/board_walk/cam_1/0.png", "", "board_walk/cam_1/0.png"),
        ("day/intri.yml", "", "calibration/intri.yml"),
        ("day/Calib_scene.toml", "", "calibration.toml"),
        ("rig.toml", "calibration", "calibration.toml"),
        ("anna.toml", "subject.toml", "subject.toml"),
    ],
)
def test_other_names_find_their_places(studio, given, chosen, expected):
    ((take,), refused) = plan(studio, given, chosen=chosen)[1].values()
    assert [path for _, path, _ in take["files"]] == [expected] and not refused


def test_two_takes_at_once_are_two_recordings(studio, walk):
    """What lies above them is of each; names that are taken get a number."""
    given = ["s/calibration.toml", "s/other/rig.toml"]
    given += [f"s/{take}/cam_{n}.mp4" for take in ("walk", "run") for n in (1, 2)]
    known = plan(studio, *given)[1]
    assert {take["project"]: {path for _, path, _ in take["files"]} for take in known["takes"]} == {
        name: {"calibration.toml", "cam_1.mp4", "cam_2.mp4"} for name in ("walk_2", "run")
    }
    assert all(take["new"] for take in known["takes"]) and len(known["refused"]) == 1
    (take,) = plan(studio, "walk/cam_1.mp4", project="")[1]["takes"]
    assert (take["project"], take["new"]) == ("walk_2", True)
    status, answer = plan(studio, "walk\u202e/cam_1.mp4", project="")
    assert status == 400 and r"'walk\u202e' cannot be a name" in answer["error"]
    assert [path.name for path in walk.parent.glob("[!.]*")] == ["walk"]


def test_nothing_is_replaced_without_a_question_that_shows_both(studio, walk, made):
    video = (made / "cam_1.mp4").read_bytes()
    (walk / "cam_1.mp4").write_bytes(video)
    (walk / "calibration.yml").write_bytes(b"x")
    (walk / "cam_2").mkdir()
    for number in range(2):
        (walk / "cam_2" / f"{number}.png").write_bytes(picture())
    given = ["cam_1.avi", "rig.toml", "cam_2/1.png", "cam_2/2.png", "cam_3.mp4"]
    (take,) = plan(studio, *given, chosen="video", size=7)[1]["takes"]
    known = {path: replaces for _, path, replaces in take["files"]}
    assert known == {
        "cam_1.avi": True,
        "cam_2/1.png": True,
        "cam_2/2.png": False,
        "cam_3.mp4": False,
    }
    rows = {row["name"]: row for row in take["conflicts"]}
    assert rows["cam_1.mp4"]["bytes"] == len(video) and rows["cam_2/1.png"]["picture"] == "cam_2"
    assert rows["cam_1.mp4"]["new"] == {
        **{"name": "cam_1.avi", "files": 1, "bytes": 7, "modified": 0, "number": 0}
    }
    for name in ("cam_1.mp4", "cam_2"):
        assert ask(studio, f"/still?project=walk&name={name}")[1][:2] == b"\xff\xd8"
    assert ask(studio, "/still?project=walk&name=calibration.yml")[0] == 400
    before = names(walk)
    calibration = (made / "calibration.toml").read_bytes()
    for path, content in (("cam_1.mov", video), ("calibration.toml", calibration)):
        status, answer = send(studio, path, content)
        assert status == 400 and "remove it first" in answer["error"]
    assert send(studio, "cam_1.mov&replace=1", b"no video")[0] == 400 and names(walk) == before
    for path, content in (("cam_1.mov", video), ("calibration.toml", calibration)):
        assert send(studio, f"{path}&replace=1", content)[0] == 200
    assert send(studio, "cam_2/1.png&replace=1", picture(1))[0] == 200
    assert names(walk) == ["calibration.toml", "cam_1.mov", "cam_2", "cam_2/0.png", "cam_2/1.png"]


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
    for path, size in (
        *(("calibration.toml", 10_000_001), ("cam_1.mp4", 0)),
        ("cam_1.mp4", LARGEST_UPLOAD + 1),
    ):
        ((take,), (line,)) = plan(studio, path, size=size)[1].values()
        assert not take["files"] and "are taken" in line
    full = shutil.disk_usage(walk)._replace(free=2**30 + 12)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: full)
    ((take,), (line,)) = plan(studio, "cam_1.mp4", "cam_2.mp4")[1].values()
    assert [path for _, path, _ in take["files"]] == ["cam_1.mp4"] and "the disk is full" in line


def test_what_is_cut_off_leaves_nothing(studio, walk, made):
    content = (made / "cam_1.mp4").read_bytes()
    link = socket.create_connection(("127.0.0.1", studio.port), timeout=10)
    head = (
        "POST /upload?project=walk&path=cam_1.mp4 HTTP/1.1\r\n"
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
    assert send(studio, "cam_1.mp4", content, **headers)[0] == status
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
        status, answer = send(studio, "background/cam_1.mp4", content)
        assert status == 400 and f"'walk/{link}' lies outside of" in answer["error"]
        for path in (
            *("/api/project?project=walk", "/sheet/board?project=walk", "/rig?project=walk"),
            *("/still?project=walk&name=boards/a.png", "/check/walk/", "/api/live?project=walk"),
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
