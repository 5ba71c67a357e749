"""The setup page's server: who may ask, and what it makes of requests that somebody damaged."""

import json
import re
import shutil
import socket
import time
from dataclasses import asdict, replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.files import read_rig
from silhouette_core.image import seen_people
from tests.silhouette_core.image.drawn_people import BrightPeople
from tests.sources import figure_masks, ring, turned, write_figure, write_recording
from tests.voxelpose.setup_page.setup_scenes import SIZE, ask, opened, served, staged
from voxelpose.recording.folder import Recording
from voxelpose.setup_page.check_findings import repair_folder
from voxelpose.setup_page.page_requests import LARGEST_BODY, SaveRequest, SilhouetteRequest
from voxelpose.view.serving.page_answers import parse_request

TOKEN = "open & sesame"
POSTS = (
    *("/api/silhouettes", "/api/stage", "/api/points", "/api/ground", "/api/save"),
    *("/api/check/start", "/api/check/repair"),
)
KEYS = (
    "places points fit regions unknown cam_1 name up pixels polygons painted moment height_m"
    " position_m camera stage pixel"
).split()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("served") / "walk", ring(2, SIZE))


@pytest.fixture(scope="module")
def local(folder):
    with served(folder) as server:
        yield server


@pytest.fixture(scope="module")
def guarded(folder):
    with served(folder, token=TOKEN) as server:
        yield server


@pytest.mark.parametrize("path", ["/", "/main.js", "/api/state", "/picture/cam_1?moment=0", *POSTS])
def test_without_the_token_nothing_is_answered(guarded, path):
    body = {} if path in POSTS else None
    for headers in ({}, {"Cookie": "voxelpose=1"}):
        status, content = ask(guarded, path, body, **headers)
        assert status == 401 and b"token" in content
    status, _ = ask(guarded, f"{path}{'&' if '?' in path else '?'}token=wrong", body)
    assert status == 401


def test_the_token_opens_the_page(guarded):
    host = f"http://127.0.0.1:{guarded.port}"
    assert guarded.url == f"{host}/?token=open%20%26%20sesame"
    link = socket.create_connection(("127.0.0.1", guarded.port))
    link.sendall(f"GET /?token=open%20%26%20sesame HTTP/1.1\r\nHost: {host[7:]}\r\n\r\n".encode())
    cookie = link.recv(4096).decode().partition("Set-Cookie: ")[2].partition(";")[0]
    link.close()
    assert ask(guarded, "/", Cookie=cookie)[0] == 200
    assert ask(guarded, "/api/ground", {}, Cookie=cookie, Origin=host)[0] == 200
    assert ask(guarded, "/api/ground", {}, Cookie=cookie, Origin="http://evil.example")[0] == 403


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example:80"}, 403),
        ({"Content_Type": "text/plain"}, 400),
        ({"Content_Type": "application/x-www-form-urlencoded"}, 400),
        ({"Transfer_Encoding": "chunked"}, 400),
        ({"Content_Length": "-1"}, 400),
        ({"Content_Length": str(LARGEST_BODY + 1)}, 413),
        ({"Upgrade": "websocket"}, 400),
    ],
)
def test_foreign_and_odd_requests_write_nothing(local, folder, headers, status):
    body = {"places": {"unknown": {"cam_1": [[[0, 0], [9, 0], [9, 9]]]}}}
    assert ask(local, "/api/save", body, **headers)[0] == status
    assert not (folder / "recording.toml").exists()


def test_the_page_loads_nothing_from_elsewhere(local):
    for path in ("/", "/style.css", "/main.js", "/findings.js"):
        status, content = ask(local, path)
        assert status == 200 and isinstance(content, bytes) and b"://" not in content
    assert ask(local, "/page_requests.py")[0] == ask(local, "/../pyproject.toml")[0] == 404


@pytest.mark.parametrize(
    "path",
    [
        "/picture/cam_9?moment=0",
        "/picture/cam_1?moment=99",
        "/picture/cam_1?moment=-1",
        "/picture/cam_1?moment=1e9",
        "/picture/cam_1",
        "/painted/region/cam_1",
        "/painted/x/cam_9",
    ],
)
def test_pictures_that_are_not_there_are_said_in_a_line(local, path):
    status, content = ask(local, path)
    assert status == 400 and isinstance(content, dict) and len(content["error"]) < 200


def test_silhouettes_without_an_empty_view_are_made_with_the_network(tmp_path, monkeypatch):
    folder = staged(tmp_path / "staged", 2)
    shutil.rmtree(folder / "background")
    asked = parse_request(b'{"moment": 3, "background": "moving", "places": {}}', SilhouetteRequest)

    def silhouettes():
        session = opened(folder)
        while not (answer := session.silhouettes(asked))["ready"]:
            time.sleep(0.05)
        session.close()
        return answer["note"], [one["share"] for one in answer["cameras"].values()]

    monkeypatch.setattr(seen_people, "installed_network", lambda use: None)
    note, _ = silhouettes()
    assert note.startswith("cam_1, cam_2: no empty view") and "network install" in note
    monkeypatch.setattr(seen_people, "installed_network", lambda use: use == "auto" and tmp_path)
    monkeypatch.setattr(seen_people, "PoseNetwork", lambda path: BrightPeople(channel=2))
    note, shares = silhouettes()
    pictures = next(iter(Recording.open(folder).at([3])))
    true = [(picture[..., 2] > 150).mean() for picture in pictures.values()]
    assert note == "" and shares == pytest.approx(true, rel=0.2)


DAMAGED = [
    b"",
    b"{",
    b"[]",
    b"null",
    b"\xff\xfe",
    b"[" * 100_000,
    b'{"points": 1}',
    b'{"nobody": 1}',
    b'{"places": {"unknown": {"cam_9": []}}}',
    b'{"places": {"unknown": {"cam_1": [[[0, 0], [1, 1]]]}}}',
    b'{"places": {"unknown": {"cam_1": [[[0, 0], [1, 1], [NaN, 2]]]}}}',
    b'{"places": {"unknown": {"cam_1": [[[0, 0], [1, 1], [1e300, 2]]]}}}',
    b'{"places": {"regions": {"../x": {"painted": true, "polygons": []}}}}',
    b'{"points": [{"name": "a\\nb"}]}',
    b'{"points": [{"name": ""}]}',
    b'{"points": [{"name": " a"}]}',
    b'{"points": [{"name": "a"}, {"name": "a"}]}',
    b'{"points": [{"name": "a", "position_m": [1, 2]}]}',
    b'{"points": [{"name": "a", "position_m": [1, 2, 1e9]}]}',
    b'{"fit": {"background": "other"}}',
    b'{"fit": {"tolerance": -1}}',
    b'{"fit": {"out": "x"}}',
    b'{"fit": {"up": "sideways"}}',
    b'{"fit": {"voxel": 1e-9}}',
    b'{"fit": {"cameras": ""}}',
    b'{"fit": {"cameras": ["cam_1"]}}',
    b'{"fit": {"tolerance": true}}',
]


@pytest.mark.parametrize("body", DAMAGED, ids=range(len(DAMAGED)))
def test_damaged_requests_are_refused_in_a_line(local, folder, body, capfd):
    before = sorted(path.name for path in folder.rglob("*"))
    status, content = ask(local, "/api/save", body)
    assert status == 400 and isinstance(content, dict)
    assert 0 < len(content["error"]) < 400 and "\n" not in content["error"]
    assert sorted(path.name for path in folder.rglob("*")) == before
    assert "Traceback" not in capfd.readouterr().err


WORDS = st.text(max_size=20) | st.sampled_from(["cam_1", "z", "auto"])
JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | WORDS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4)
    ),
    max_leaves=20,
)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(content=JSON, path=st.sampled_from(POSTS[:4]))
def test_no_request_is_a_bug(local, content, path):
    status, answer = ask(local, path, json.dumps(content).encode())
    assert status in (200, 400), answer


def test_bounds_of_numbers_hold():
    most = {"points": [{"name": "a", "pixels": {"cam_1": [30000, -30000]}}]}
    assert parse_request(json.dumps(most).encode(), SaveRequest)
    most["points"][0]["pixels"]["cam_1"][0] = 30000.1
    with pytest.raises(InputError, match="not understood"):
        parse_request(json.dumps(most).encode(), SaveRequest)


def test_two_pages_do_not_overwrite_each_other_without_a_word(tmp_path):
    walk = write_recording(tmp_path / "walk", ring(2, SIZE))
    with served(walk) as server:

        def save(stature: float, seen: str) -> dict:
            status, answer = ask(server, "/api/save", {"fit": {"stature": stature}, "seen": seen})
            assert status == 200
            return answer

        seen = ask(server, "/api/state")[1]["seen"]  # of both pages
        later = save(1.7, seen)["state"]["seen"]
        assert "load it again" in save(1.8, seen)["meanwhile"]
        assert (walk / "voxelpose.toml").read_text() == "[fit]\nstature = 1.7\n"
        assert save(1.8, "")["written"] == ["voxelpose.toml"]  # all the same
        assert "meanwhile" in save(1.7, later)
        now = ask(server, "/api/state")[1]["seen"]
        (walk / "points.csv").write_text("camera,point,x_px,y_px\n")
        assert "meanwhile" in save(1.7, now)
        now = ask(server, "/api/state")[1]["seen"]
        drawn = {"cam_1": {"painted": False, "polygons": [[[0, 0], [9, 0], [9, 9]]]}}
        assert ask(server, "/api/save", {"places": {"regions": drawn}})[0] == 200
        assert ask(server, "/api/state")[1]["seen"] != now


def test_the_check_runs_beside_and_says_what_calibrate_check_says(tmp_path):
    from voxelpose.calibration.check import check_findings, check_recording
    from voxelpose.recording.folder import Recording

    walk = staged(tmp_path / "walk")
    expected = check_recording(Recording.open(walk))
    with served(walk) as server:
        check = server.session.check_status
        assert check() == {"state": "idle"}
        assert ask(server, "/api/check/start", {}) == (200, {})
        while (content := check())["state"] == "running":
            assert ask(server, "/api/ground", {})[0] == 200  # meanwhile
        assert content["state"] == "done" and content["summary"] == expected.agreement.summary
        assert [line["camera"] for line in content["cameras"]] == ["cam_1", "cam_2", "cam_3"]
        assert content["findings"] == [asdict(each) for each in check_findings(expected)[1:]]
        assert content["picture"][:4] == b"\x89PNG"


def test_a_turned_camera_is_repaired_from_the_page(tmp_path):
    rig = Rig(tuple(replace(c, translation=1000 * c.translation) for c in ring(4, (240, 180))))
    true = ring(4, (240, 180))
    films = {camera.name: figure_masks(camera, range(20)) for camera in true}
    folder = write_figure(tmp_path, turned(rig, "cam_3", 2), films)
    file, kept = folder / "calibration.toml", folder / "voxelpose.toml"
    file.write_text(re.sub("unit = .*", "", file.read_text()))
    kept.write_text('[fit]\nunit = "mm"\nvoxel = 0.03\n')
    before = file.read_bytes()
    with served(folder, unit="mm") as server:
        status, content = ask(server, "/api/check/repair", {})
        assert status == 400 and "check the cameras first" in content["error"]
        ask(server, "/api/check/start", {})
        while (found := server.session.check_status())["state"] == "running":
            time.sleep(0.1)
        assert "press Repair" in found["findings"][0]["remedy"] and not found["agrees"]
        file.write_text(file.read_text() + "# by somebody else\n")
        status, content = ask(server, "/api/check/repair", {})
        assert status == 400 and "have changed since: check again" in content["error"]
        file.write_bytes(before)
        assert ask(server, "/api/check/repair", {}) == (200, {"written": ["calibration.toml"]})
        assert server.session.check_status() == {"state": "idle"}
        assert ask(server, "/api/state")[1]["fault"] == ""
        moved = read_rig(file)["cam_3"]
        assert pose_difference(moved, true["cam_3"])[1] < 0.6
    assert (folder / "before_repair" / "calibration.toml").read_bytes() == before
    assert kept.read_text() == "[fit]\nvoxel = 0.03\n"
    assert not Recording.open(folder).notes


def test_of_several_repairs_the_files_before_the_first_are_kept(tmp_path):
    for text in ("first", "second"):
        repair_folder(tmp_path, {"calibration.toml": text, "timestamps.csv": text})
    kept = tmp_path / "before_repair" / "calibration.toml"
    assert kept.read_text() == "first"  # nothing was there before that
    repair_folder(tmp_path, {"calibration.toml": "third"})
    assert kept.read_text() == "first" and (tmp_path / "calibration.toml").read_text() == "third"
    blocked = tmp_path / "blocked"
    blocked.mkdir()
    (blocked / "calibration.toml").write_text("old")
    (blocked / "before_repair").write_text("a file")
    with pytest.raises(InputError, match="cannot be written"):
        repair_folder(blocked, {"calibration.toml": "new"})
    assert (blocked / "calibration.toml").read_text() == "old"


def test_a_check_can_be_stopped_and_ends_with_the_session(tmp_path):
    with served(staged(tmp_path / "walk")) as server:
        assert ask(server, "/api/check/start", {})[0] == 200
        status, content = ask(server, "/api/check/start", {})
        assert status == 400 and "the check of walk is still running" in content["error"]
        number = server.session.check_status()["number"]
        assert ask(server, "/api/stop", {"number": number})[0] == 200
        while server.session.check_status()["state"] == "running":
            time.sleep(0.05)
        assert server.session.check_status()["state"] == "stopped"
        assert ask(server, "/api/check/start", {})[0] == 200
