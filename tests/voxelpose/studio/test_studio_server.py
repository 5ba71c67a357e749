"""The studio's server: who may ask, its one job, results, and the archive."""

import io
import json
import re
import shutil
import time
import urllib.request
import zipfile

import pytest

from calib.errors import InputError
from calib.storage.documents import visible_entries
from silhouette_core.progress import SilentReporter
from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import ended, opened_studio
from voxelpose.cli.options import folder_settings, load_command, options_of
from voxelpose.results import is_result
from voxelpose.studio.command_forms import filled_in
from voxelpose.studio.projects import StudioFolder
from voxelpose.studio.studio_jobs import JOBS_FILE, estimate
from voxelpose.studio.studio_session import StudioSession
from voxelpose.view.serving.page_job import StepError

TOKEN = "open sesame"
POSTS = (
    *("/api/new", "/api/plan", "/api/remove", "/api/fit", "/api/export", "/api/board"),
    *("/api/calibrate", "/api/calibration", "/api/record", "/api/live", "/api/receivers"),
    *("/api/ask", "/api/stop", "/api/fits", "/api/demo", "/api/repeat", "/api/queue", "/upload"),
)
GETS = (
    "/",
    "/api/state",
    "/api/project?project=walk",
    "/check/walk/",
    "/view/fitted/-/",
    "/events",
    "/api/calibration?project=walk",
    "/api/cameras?project=walk",
    "/api/live?project=walk",
    "/preview?camera=cam_1",
    "/still?project=walk&name=boards/cam_1",
    "/rig?project=walk",
    "/sheet/board?project=walk",
    "/live/-/",
    "/download?result=fitted",
    "/report?result=fitted",
)
STANDING = {"estimator": "standing", "stature": 1.8, "pictures": False}


@pytest.fixture
def studio(desk):
    """The studio of a recording by two cameras."""
    write_staged(desk / "root" / "walk", waving(4), ring(2, (320, 240)))
    with opened_studio(desk / "root") as server:
        yield server


def start(server, out="fitted", **settings) -> tuple:
    asked = {"project": "walk", "command": "fit", "out": out, "settings": STANDING | settings}
    return ask(server, "/api/fit", asked)


def fetched(server, path: str) -> bytes:
    with urllib.request.urlopen(f"http://127.0.0.1:{server.port}{path}", timeout=60) as answer:
        assert re.search("frame-ancestors '(none|self)'", answer.headers["Content-Security-Policy"])
        return answer.read()


def test_without_the_token_nothing_is_answered(tmp_path):
    (tmp_path / "walk").mkdir()
    with opened_studio(tmp_path, TOKEN) as server:
        for path in (*GETS, *POSTS):
            body = {} if path in POSTS else None
            assert ask(server, path, body)[0] == 401, path
            assert ask(server, path, body, Origin="http://evil.example")[0] == 403, path
    assert not list((tmp_path / "walk").iterdir())


@pytest.mark.parametrize("path", POSTS[:-1])
def test_what_nobody_understands_is_refused_in_a_line(studio, path, capfd):
    for body in (b"{", b"[]", b'{"nobody": 1}', b'{"name": 1}', b"\xff", b"[" * 9000):
        status, answer = ask(studio, path, body)
        assert path == "/api/stop" or (status == 400 and "\n" not in answer["error"])
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("name", ["..", ".", "../away", "a/b", "/etc", "", "x" * 81, "a\0b", "c:"])
def test_no_name_leads_out_of_the_folder(studio, desk, name):
    (desk / "away").mkdir()
    before = sorted(desk.rglob("*"))
    for path, body in (
        ("/api/new", {"name": name}),
        ("/api/fit", {"project": name, "command": "fit", "out": "x"}),
        ("/api/fit", {"project": "walk", "command": "fit", "out": name or "."}),
        ("/api/export", {"result": name, "formats": ["bvh"]}),
        ("/api/remove", {"project": name, "name": "cam_1.mkv"}),
        ("/api/remove", {"project": "walk", "name": name}),
    ):
        status, answer = ask(studio, path, body)
        assert status == 400 and answer["error"], (path, body)
    for path in ("/api/project?project=", "/sheet?result=", "/download?result=", "/report?result="):
        assert ask(studio, path + urllib.parse.quote(name, safe=""))[0] == 400
    assert sorted(desk.rglob("*")) == before
    assert studio._session.job.status() == {"state": "idle"}


@pytest.mark.parametrize(
    ("settings", "line", "field"),
    [
        ({"body": "/etc/passwd"}, "lies outside of", ""),
        ({"body": "../../away.toml"}, "lies outside of", ""),
        ({"network": "on"}, "must be one of auto, off", "network"),
        ({"out": "elsewhere"}, "the page has no setting 'out'", ""),
        ({"overwrite": True}, "the page has no setting 'overwrite'", ""),
        ({"stature": "tall"}, "`stature` = 'tall' must be a number", "stature"),
        ({"sex": "x"}, "must be one of male, female, unknown", "sex"),
        ({"frames": "first"}, "`frames` first is not understood", "frames"),
        ({"frames": "3:9"}, "`frames` 3:9 are not in the recording", "frames"),
        ({"cameras": "cam_9"}, "for `cameras`, are cam_1, cam_2", "cameras"),
        ({"gap-limit": "long"}, "gap limit 'long'", "gap-limit"),
        ({"cutoff": 0}, "a cut-off of 0 Hz cannot be used", "cutoff"),
        ({"up": "away"}, "`up` away", "up"),
    ],
)
def test_settings_are_checked_before_the_work(studio, desk, settings, line, field):
    (desk / "away.toml").write_text("")
    asked = {"project": "walk", "command": "fit", "out": "x", "settings": settings}
    status, answer = ask(studio, "/api/fit", asked)
    assert status == 400 and line in answer["error"] and answer["field"] == field
    assert not (desk / "root" / "walk" / "voxelpose.toml").exists()


def test_the_form_is_the_commands_own(studio, desk):
    (desk / "root" / "walk" / "voxelpose.toml").write_text("[fit]\ncutoff = 5\n[track]\n")
    for command in ("fit", "track"):
        rows = ask(studio, f"/api/form?project=walk&command={command}")[1]
        named = {row["name"]: row for row in rows}
        expected = options_of(load_command(command)).keys() - {"out", "overwrite", "verbose"}
        assert named.keys() == expected
        assert all(row["help"] for row in rows)
        assert [row["group"] for row in rows[:3]] == ["basic"] * 3
        assert named["sex"]["choices"] == ["male", "female", "unknown"]
        assert named["smooth"]["input"] == "checkbox" and named["smooth"]["usual"] is True
        assert named["cutoff"]["value"] == (5 if command == "fit" else None)


@pytest.mark.slow
def test_a_fit_is_followed_refused_a_second_time_and_exported(studio, desk):
    assert start(studio)[0] == 200
    assert start(studio, "more")[0] == 200
    waiting = studio._session.job.states()[-1]
    assert (waiting["state"], waiting["of"]) == ("waiting", "walk")
    assert ask(studio, "/api/project?project=walk")[1]["outs"]["fit"] == "walk_fit"
    assert ask(studio, "/api/stop", {"number": waiting["number"]})[0] == 200
    status, answer = ask(studio, "/api/remove", {"project": "walk", "name": "cam_1.mkv"})
    assert status == 400 and "reads its files" in answer["error"]
    seen = events(studio)
    assert seen[0]["state"] == "running" and seen[-1]["state"] == "done"
    assert seen[-1]["result"] == "fitted"
    assert not (desk / "root" / "more").exists()
    (result,) = ask(studio, "/api/state")[1]["results"]
    assert result["project"] == "walk" and result["frames"] == "3 of 4 frames"
    assert result["level"] == "doubtful" and result["words"].startswith("doubtful: ")
    saved = folder_settings("fit", desk / "root" / "walk")
    assert {name: setting.value for name, setting in saved.items()} == STANDING
    assert "already: choose another name" in start(studio)[1]["error"]
    assert b"<title>fitted" in fetched(studio, "/view/fitted/-/")
    assert ask(studio, "/view/fitted/-/nothing")[0] == 404
    assert ask(studio, "/view/other/-/")[0] == 400
    assert ask(studio, "/download?result=fitted")[0] == 400  # nothing is exported yet
    archive(studio)
    fitted_again(studio)
    people(studio, desk)


def events(server) -> list[dict]:
    """States of the latest job until it has ended, as they are sent."""
    found: list[dict] = []
    url = f"http://127.0.0.1:{server.port}/events"
    with urllib.request.urlopen(url, timeout=60) as answer:
        assert answer.headers["Content-Type"] == "text/event-stream"
        for line in answer:
            if line.startswith(b"data: "):
                sent = json.loads(line[6:])
                found += [] if sent == 0 else sent["changed"][-1:]
                if found[-1]["state"] not in ("running", "waiting"):
                    break
    return found


def archive(server) -> None:
    nothing = {"result": "fitted", "formats": []}
    assert "nothing is chosen" in ask(server, "/api/export", nothing)[1]["error"]
    strange = {"formats": ["bvh"], "settings": {"skeleton": "biped"}}
    assert "must be one of" in ask(server, "/api/export", nothing | strange)[1]["error"]
    asked = {"result": "fitted", "formats": ["bvh", "csv", "obj"], "report": True}
    assert ask(server, "/api/export", asked)[0] == 200
    state = ended(server)
    assert state["state"] == "done", state
    with zipfile.ZipFile(io.BytesIO(fetched(server, "/download?result=fitted"))) as zipped:
        assert zipped.testzip() is None and zipped.namelist() == state["files"]
        assert {"motion.bvh", "angles.csv", "report.html"} <= {*zipped.namelist()}
    assert b"voxelpose" in fetched(server, "/report?result=fitted")


def fitted_again(server) -> None:
    """Frames that the viewer has fitted again are a job of the studio."""
    fetched(server, "/view/fitted/-/")
    asked = {"frames": [1, 3], "camera": "cam_1"}
    assert ask(server, "/view/fitted/-/api/fit_again", asked) == (200, {})
    state = ended(server)
    assert (state["state"], state["of"]) == ("failed", "fitted")
    assert "without cam_1 1 camera is left" in state["error"]


def people(server, desk) -> None:
    """Several people are one result, also in the folder of a batch."""
    root, names = desk / "root", ["person_1", "person_2"]
    for folder in (root / "duo", root / "many" / "duo"):
        for person in names:
            shutil.copytree(root / "fitted", folder / person)
        index = {"voxelpose": "0", "people": {name: {} for name in names}, "seconds": {"total": 1}}
        (folder / "summary.json").write_text(json.dumps(index))
    settings = root / "duo" / "person_1" / "settings.toml"
    settings.write_text(settings.read_text().replace("../walk", "../../walk"))
    state = ask(server, "/api/state")[1]
    found = {result["name"]: result for result in state["results"]}
    assert found.keys() == {"fitted", "duo", "many/duo"}
    assert found["duo"]["project"] == "walk" and found["many/duo"]["project"] is None
    assert found["duo"]["frames"] == "2 people, 3 of 4, 3 of 4 frames"
    assert found["duo"]["words"].startswith("doubtful: person_1: ")
    assert [one["name"] for one in state["projects"]] == ["walk"]
    assert found["duo"]["people"] == names and found["fitted"]["people"] == []
    asked = {"result": "duo", "formats": ["bvh", "glb"]}
    assert ask(server, "/api/export", asked)[0] == 200
    assert {"motion.glb", "person_2/motion.bvh"} <= {*ended(server)["files"]}
    assert (
        "has no person 'eve'" in ask(server, "/api/export", asked | {"person": "eve"})[1]["error"]
    )
    asked |= {"person": "person_2", "settings": {"skeleton": "vrm", "frames": "0:9"}}
    assert ask(server, "/api/export", asked)[0] == 200
    assert "person_2/export/motion.glb" in ended(server)["files"]
    settings.write_text(settings.read_text().replace("../../walk", "../../../walk"))
    status, answer = ask(server, "/view/duo/-/")
    assert status == 400 and "lies outside of" in answer["error"]


@pytest.mark.parametrize(
    ("settings", "file", "step", "line"),
    [
        ({"frames": "3:9"}, None, "fit", "frames 3:9 are not in the recording"),
        ({"cameras": "cam_9"}, None, "fit", "no video of cam_9"),
        ({}, "calibration.toml", "import", "holds no calibration"),
        ({"estimator": "multiview"}, "cam_2.mkv", "import", "camera cam_2"),
    ],
)
def test_an_error_names_the_step_that_mends_it(desk, settings, file, step, line):
    walk = write_staged(desk / "walk", waving(2), ring(2, (320, 240)))
    if file is not None:
        (walk / file).unlink()
    folder = StudioFolder(desk)
    fixed = {"recording": walk, "out": desk / "x"}
    command = filled_in("fit", folder, walk, fixed, STANDING | settings)
    with pytest.raises(StepError) as error:
        estimate(SilentReporter(), command, folder.root)
    assert error.value.step == step and line in str(error.value)


@pytest.mark.slow
def test_a_fit_that_is_stopped_leaves_nothing(studio, desk):
    assert start(studio, voxel=0.09)[0] == 200  # a second a frame
    end = time.monotonic() + 60
    while studio._session.job.status()["stage"] != "standing about":
        assert time.monotonic() < end
        time.sleep(0.05)
    assert ask(studio, "/api/stop", {})[0] == 200
    assert ended(studio)["state"] == "stopped"
    assert [path.name for path in visible_entries(desk / "root")] == ["walk"]
    assert start(studio, voxel=None)[0] == 200  # the next may begin, and ends with the studio
    assert not is_result(desk / "root" / "fitted")


def test_a_job_that_was_interrupted_is_named_and_begun_again(desk):
    root = desk / "root"
    for name in ("walk", "walk_fit.partial-12-0123abcd"):
        write_staged(root / name, waving(2), ring(2, (320, 240)))
    with opened_studio(root) as server:
        assert start(server)[0] == 200
        assert start(server, "more")[0] == 200
    with opened_studio(root) as server, opened_studio(root) as other:
        assert other._session.job.states() == []  # it is the first one's
        first, second = server._session.job.states()
        assert (first["state"], first["kind"], first["of"]) == ("interrupted", "fit", "walk")
        assert [first["into"], second["into"]] == ["fitted", "more"]
        assert [one["name"] for one in ask(server, "/api/state")[1]["projects"]] == ["walk"]
        assert ask(server, "/api/repeat", {"number": second["number"]})[0] == 200
        assert ask(server, "/api/repeat", {"number": 99})[0] == 400
        states = [state["state"] for state in server._session.job.states()]
        assert states == ["interrupted", "running"]
        ask(server, "/api/stop", {"number": first["number"]})
        ask(server, "/api/stop", {})
        assert ended(server)["state"] == "stopped"
    assert not (root / JOBS_FILE).exists()
    (root / JOBS_FILE).write_text('[{"kind": "fit", "of": "walk", "asked": {"type": "Other"}}]')
    with opened_studio(root) as server:
        (state,) = server._session.job.states()
        status, answer = ask(server, "/api/repeat", {"number": state["number"]})
        assert status == 400 and "not understood" in answer["error"]
    (root / JOBS_FILE).write_text("[")
    with pytest.raises(InputError, match=r"jobs\.json is damaged: remove it"):
        StudioSession(StudioFolder(root))


def test_all_recordings_and_the_demo_wait_for_each_other(studio, desk):
    write_staged(desk / "root" / "run", waving(2), ring(2, (320, 240)))
    (desk / "root" / "new").mkdir()
    assert ask(studio, "/api/demo", {})[0] == 200
    status, answer = ask(studio, "/api/fits", {"projects": ["walk", "new", "run"]})
    assert status == 200 and list(answer["refused"]) == ["new"]
    states = studio._session.job.states()
    assert [state["of"] for state in states] == ["demo_recording", "walk", "run"]
    assert ask(studio, "/api/queue", {"number": states[2]["number"], "other": states[1]["number"]})
    assert [state["of"] for state in studio._session.job.states()][1:] == ["run", "walk"]


def test_the_check_of_a_project_is_its_set_up(studio):
    status, page = ask(studio, "/check/walk/")
    assert status == 200 and b'id="tiles"' in page
    state = ask(studio, "/check/walk/api/state")[1]
    assert state["name"] == "walk" and state["studio"] == "../../"
    assert ask(studio, "/check/walk/picture/cam_1?moment=0")[1][:2] == b"\xff\xd8"
    places = {"unknown": {"cam_1": [[[0, 0], [9, 0], [9, 9]]]}}
    written = ask(studio, "/check/walk/api/save", {"places": places})[1]["written"]
    assert written == ["recording.toml"]
    assert ask(studio, "/check/walk/api/save", {}, Origin="http://evil.example")[0] == 403
    assert ask(studio, "/check/nobody/")[0] == 400
