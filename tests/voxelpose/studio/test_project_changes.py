"""Projects and results renamed, duplicated, deleted and put back, by way of the server."""

import json
import os
import time
from pathlib import Path

import pytest

from tests.clips import FIRST_SUMMARY
from tests.voxelpose.setup_page.setup_scenes import ask
from tests.voxelpose.studio.studio_scenes import opened_studio

SETTINGS = """recording = "{}walk"
frames = [10, 90]
cameras = ["cam_1", "cam_3"]
stature_m = 1.8
smooth = false
[conditioning]
cutoff_hz = 5.0
[options]
voxel_size_m = 0.02
"""


def write_result(folder: Path, above: str = "../") -> None:
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text(json.dumps(FIRST_SUMMARY))
    (folder / "settings.toml").write_text(SETTINGS.format(above))


@pytest.fixture
def studio(tmp_path):
    """The studio of a project with a video and a result, and a result of it in a batch's folder."""
    root = tmp_path / "root"
    (root / "walk").mkdir(parents=True)
    for name in ("cam_1.mp4", "subject.toml"):
        (root / "walk" / name).write_text("stature = 1.8")
    write_result(root / "walk_fit")
    write_result(root / "many" / "walk", "../../")
    with opened_studio(root) as server:
        yield server


def state(server) -> tuple[list, dict, list]:
    """Names of projects, projects of results by name, names in the bin."""
    content = ask(server, "/api/state")[1]
    results = {result["name"]: result["project"] for result in content["results"]}
    return [one["name"] for one in content["projects"]], results, content["bin"]


def test_results_follow_their_project_by_its_new_name(studio):
    assert ask(studio, "/api/rename", {"name": "walk", "to": "anna"})[0] == 200
    assert ask(studio, "/api/rename", {"name": "many/walk", "to": "first"})[0] == 200
    assert state(studio) == (["anna"], {"walk_fit": "anna", "many/first": "anna"}, [])


@pytest.mark.parametrize("path", ["/api/rename", "/api/duplicate"])
@pytest.mark.parametrize("to", ["walk_fit", "a/b", "..", ".hidden", "x" * 81, "con"])
def test_a_name_that_cannot_be_is_refused_at_its_field(studio, path, to):
    status, answer = ask(studio, path, {"name": "walk", "to": to})
    assert status == 400 and answer["field"] == "to"
    assert state(studio)[0] == ["walk"]


@pytest.mark.parametrize(
    "name", ["nobody", "..", "many/nobody", "walk/cam_1.mp4", ".bin", "many/../walk"]
)
def test_only_projects_and_results_are_moved(studio, name):
    for path, more in (("/api/rename", {"to": "new"}), ("/api/delete", {})):
        assert ask(studio, path, {"name": name} | more)[0] == 400
    assert state(studio) == (["walk"], {"walk_fit": "walk", "many/walk": "walk"}, [])


def test_a_duplicate_changes_by_itself(studio):
    root = studio._session.folder.root
    assert ask(studio, "/api/duplicate", {"name": "walk", "to": "other"})[0] == 200
    assert ask(studio, "/api/remove", {"project": "other", "name": "cam_1.mp4"})[0] == 200
    (root / "other" / "subject.toml").write_text("stature = 1.6")
    assert (root / "walk" / "cam_1.mp4").exists()
    assert (root / "walk" / "subject.toml").read_text() == "stature = 1.8"
    assert sorted(path.name for path in root.glob("[!.]*")) == ["many", "other", "walk", "walk_fit"]


def test_what_is_deleted_can_be_put_back_for_a_day(studio, monkeypatch):
    for name in ("walk", "many/walk"):
        assert ask(studio, "/api/delete", {"name": name})[0] == 200
    projects, results, deleted = state(studio)
    assert projects == [] and results == {"walk_fit": "walk"}
    assert [one["name"] for one in deleted] == ["many/walk", "walk"] and deleted[1]["bytes"] == 26
    for one in deleted:
        assert ask(studio, "/api/put_back", {"deleted": one["id"]})[0] == 200
    assert state(studio) == (["walk"], {"walk_fit": "walk", "many/walk": "walk"}, [])
    assert "not in the bin" in ask(studio, "/api/put_back", {"deleted": "1"})[1]["error"]
    ask(studio, "/api/delete", {"name": "walk"})
    ask(studio, "/api/new", {"name": "walk"})
    (one,) = state(studio)[2]
    assert "already" in ask(studio, "/api/put_back", {"deleted": one["id"]})[1]["error"]
    now = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: now + 23 * 3600 * 10**9)
    assert len(state(studio)[2]) == 1
    monkeypatch.setattr(time, "time_ns", lambda: now + 25 * 3600 * 10**9)
    assert state(studio)[2] == []
    assert os.listdir(studio._session.folder.root / ".bin") == []  # noqa: PTH208


def test_the_bin_is_emptied_and_leads_nowhere_else(studio, tmp_path):
    root = studio._session.folder.root
    ask(studio, "/api/delete", {"name": "walk_fit"})
    assert ask(studio, "/api/empty", {})[0] == 200 and state(studio)[2] == []
    (root / ".bin").rmdir()
    (tmp_path / "away" / "1" / "precious").mkdir(parents=True)
    (root / ".bin").symlink_to(tmp_path / "away")
    assert "lies outside" in ask(studio, "/api/delete", {"name": "walk"})[1]["error"]
    ask(studio, "/api/empty", {})
    assert (tmp_path / "away" / "1" / "precious").is_dir() and (root / "walk").is_dir()


def test_a_form_begins_with_the_settings_of_a_result(studio):
    rows = ask(studio, "/api/form?project=walk&command=fit&like=walk_fit")[1]
    values = {row["name"]: row["value"] for row in rows if row["value"] is not None}
    assert values == {
        "stature": 1.8,
        "frames": "10:90",
        "cameras": "cam_1,cam_3",
        "smooth": False,
        "cutoff": 5.0,
        "voxel": 0.02,
    }
