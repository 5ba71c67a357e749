"""A live session of the studio: begun, told, shown behind the same gate, and ended."""

import http.client
import json

import pytest

from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.live.fake_session import FakeControls
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import ended, opened_studio, until
from voxelpose.cli.options import folder_settings, load_command, options_of
from voxelpose.live.live_frame import SessionState
from voxelpose.live.live_page import Page
from voxelpose.view.serving.gate import Address

TOKEN = "open sesame"


@pytest.fixture
def walk(tmp_path):
    return write_staged(tmp_path / "root" / "walk", waving(30), ring(2, (160, 120)))


def start(server, headers: dict | None = None, **more) -> tuple:
    return ask(server, "/api/live", {"project": "walk"} | more, **(headers or {}))


def cookie(server) -> str:
    link = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    link.request("GET", "/?token=open%20sesame")
    found = link.getresponse().getheader("Set-Cookie").partition(";")[0]
    link.close()
    return found


@pytest.mark.slow
def test_a_session_is_run_told_shown_and_ended(walk):
    with opened_studio(walk.parent, TOKEN) as server:
        assert start(server)[0] == 401
        known = {"Cookie": cookie(server)}
        status, answer = ask(server, "/live/-/", **known)
        assert status == 400 and "no live session is running" in answer["error"]
        receivers = ["vmc://127.0.0.1:39539"]
        more = {"receivers": receivers, "settings": {"stature": 1.75}}
        assert start(server, known, **more)[0] == 200
        state = until(server, lambda state: state.get("phase") in ("searching", "following"))
        assert [*state["cameras"]] == ["cam_1", "cam_2"]
        assert [one["address"] for one in state["receivers"]] == receivers
        status, page = ask(server, "/live/-/", **known)
        assert status == 200 and "<title>walk – live" in page.decode()
        for path in ("/live/-/", "/live/-/live.js", "/live/-/events"):
            assert ask(server, path)[0] == 401
            assert ask(server, path, Origin="http://evil.example", **known)[0] == 403
        watched(server, known["Cookie"])
        ask(server, "/api/receivers", {"receivers": ["ws://127.0.0.1:9/x"]}, **known)
        until(server, lambda state: state["receivers"][0]["address"] == "ws://127.0.0.1:9/x")
        status, answer = ask(server, "/api/receivers", {"receivers": ["udp://a"]}, **known)
        assert status == 400 and "udp://a" in answer["error"]
        until(server, lambda state: state["arriving_fps"] > 20 and state["pace"] is not None)
        ask(server, "/api/ask", {"word": "finish"}, **known)
        assert ended(server)["state"] == "done"
        saved = {name: one.value for name, one in folder_settings("live", walk).items()}
        assert saved == {"stature": 1.75, "send": tuple(receivers)}
        assert ask(server, "/live/-/", **known)[0] == 400


def watched(server, crumb: str) -> None:
    """The page's events are passed on to who may pass alone, and what its buttons ask."""
    known = {"Cookie": crumb}
    link = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    link.request("GET", "/live/-/events", headers=known)
    answer = link.getresponse()
    told = json.loads(answer.readline().removeprefix(b"data: "))
    assert told["state"]["session"]["cameras"].keys() >= {"cam_1", "cam_2"}
    answer.close()
    link.close()
    assert ask(server, "/live/-/api/ask", {"word": "start"}, **known)[0] == 200
    assert ask(server, "/live/-/api/ask", {"word": "dance"}, **known)[0] == 400
    assert ask(server, "/live/-/api/ask", {"word": "stop"})[0] == 401


def test_the_page_of_the_session_is_passed_on(walk, monkeypatch):
    controls = FakeControls()
    page = Page(controls, ring(2).cameras, Address("127.0.0.1", 0, "of-the-session"), tuple)
    with opened_studio(walk.parent, TOKEN) as server:
        state = {"state": "running", "port": page.port}
        monkeypatch.setattr(server._session.live, "_token", "of-the-session")
        monkeypatch.setattr(server._session.job, "status", lambda *_: state)
        watched(server, cookie(server))
    page.close()
    assert controls.asked == ["start"]


@pytest.mark.parametrize(
    ("more", "line"),
    [
        ({"receivers": ["udp://127.0.0.1"]}, "udp://127.0.0.1"),
        ({"receivers": ["vmc://a b"]}, "has spaces"),
        ({"sources": [{"name": "cam_1", "address": "/etc/passwd"}]}, "nor a video in the studio"),
        ({"settings": {"library": "../away"}}, "lies outside of"),
        ({"settings": {"record": "../away"}}, "the page has no setting 'record'"),
        ({"settings": {"send": ["vmc://127.0.0.1"]}}, "not understood"),
        ({"settings": {"host": "0.0.0.0"}}, "the page has no setting 'host'"),
        ({"settings": {"camera": "cam_1", "cameras": "cam_1"}}, "exclude each other"),
        ({"settings": {"countdown": -1}}, "`countdown` = '-1' must be a number from 0 to 3600"),
    ],
)
def test_what_cannot_be_followed_is_refused_before(walk, more, line):
    (walk.parent.parent / "away").mkdir()
    with opened_studio(walk.parent) as server:
        status, answer = start(server, **more)
        assert status == 400 and line in answer["error"] and "\n" not in answer["error"]
        assert server._session.job.status() == {"state": "idle"}
    assert not (walk / "voxelpose.toml").exists()


def test_the_form_is_the_commands_own(walk):
    with opened_studio(walk.parent) as server:
        known = ask(server, "/api/live?project=walk")[1]
    own = set(
        "source send loop page record record-now duration host port token browser verbose".split()
    )
    expected = options_of(load_command("live")).keys() - own
    assert {row["name"] for row in known["form"]} == expected
    assert known["there"]["take"] == ["cam_1", "cam_2"] and known["receivers"] == []


@pytest.mark.parametrize(
    ("phase", "followed", "arriving", "told"),
    [
        ("following", 3.0, 30.0, "this machine follows 3 of 30 pictures a second: use fewer"),
        ("following", 21.0, 30.0, ""),
        ("searching", 3.0, 30.0, ""),
        ("following", 0.0, 0.0, ""),
    ],
)
def test_a_machine_that_is_too_slow_is_told(phase, followed, arriving, told):
    pace = SessionState(phase, "", fps=followed, arriving_fps=arriving).pace
    assert pace.startswith(told) and bool(pace) == bool(told)
