"""voxelpose.toml of a recording, of the folders above and of the user; `voxelpose settings`."""

import json
from pathlib import Path
from typing import get_args, get_origin

import pytest

from silhouette_core.setting_types import choices_of, range_of, types_if_given
from tests.sources import ring, write_recording
from voxelpose.cli import _parse, run
from voxelpose.cli.options import load_command, options_of
from voxelpose.cli.settings import all_sections
from voxelpose.recording.subject import SETTINGS_FILE, settings_files


@pytest.fixture(autouse=True)
def user(desk, monkeypatch) -> Path:
    """The user's configuration folder; a recording `lab/walk` is on the desk."""
    folder = desk / "config"
    folder.mkdir()
    monkeypatch.setattr("voxelpose.recording.subject.user_config_path", lambda _: folder)
    (desk / "lab" / "walk").mkdir(parents=True)
    return folder


def write(folder: Path, text: str) -> Path:
    (folder / SETTINGS_FILE).write_text(text, encoding="utf-8")
    return folder / SETTINGS_FILE


def fitted(*words: str):
    return _parse("fit", ["lab/walk", *words])


def test_the_nearest_file_counts_and_the_command_line_before_all(desk, user, capsys):
    write(user, "[fit]\nstature = 1.5\nchest = 0.8\nthreads = 3\nout = 'from_user'")
    above = write(desk / "lab", "[fit]\nstature = 1.6\nchest = 0.9\nsmooth = false")
    nearest = write(desk / "lab/walk", "[fit]\nstature = 1.7\ncameras = 'cam_1,cam_2'")
    command = fitted("--out", "typed", "--smooth")
    assert (command.stature, command.chest, command.threads) == (1.7, 0.9, 3)
    assert (command.out, command.smooth, command.cameras) == (Path("typed"), True, "cam_1,cam_2")
    assert command.sources["stature"] == command.sources["cameras"] == str(nearest)
    assert command.sources["chest"] == str(above)
    assert command.sources["threads"] == str(user / SETTINGS_FILE)
    assert command.sources.keys().isdisjoint({"out", "smooth"})
    said = capsys.readouterr().err
    assert f"voxelpose: from {nearest} [fit]: stature, cameras\n" in said.replace(
        "cameras, stature", "stature, cameras"
    )
    assert fitted().out == user / "from_user"


def test_the_files_are_those_of_the_folder_and_above_then_of_the_user(desk, user):
    files = [write(folder, "") for folder in (desk / "lab/walk", desk, user)]
    assert [file for file in settings_files(Path("lab/walk")) if desk in file.parents] == files
    assert settings_files(desk / "lab" / "not_there")[0] == files[1]


def test_paths_are_relative_to_the_file(desk):
    (desk / "lab" / "me.toml").touch()
    write(desk / "lab", "[fit]\nbody = 'me.toml'\nout = 'fits/walk'\n[track]\nlibrary = '../l'")
    assert fitted().body == str(desk / "lab" / "me.toml")
    assert fitted().out == desk / "lab" / "fits" / "walk"
    tracked = _parse("track", ["lab/walk", "--camera", "cam_1", "--out", "x"])
    assert tracked.library == desk / "lab" / ".." / "l"
    write(desk / "lab", "[fit]\nbody = '92A5'\nout = '~/x'\n[track]\noutline_only = true")
    assert fitted().body == "92A5"
    assert fitted().out == Path("~/x").expanduser()
    assert _parse("track", ["lab/walk", "--camera", "cam_1", "--out", "x"]).outline_only


def test_commands_without_a_recording_take_the_current_folder(desk):
    write(desk, "[calibrate.board]\npaper = 'a3'\n[library.build]\npitch = [5, 20.5]\n[live]\n")
    assert _parse("calibrate", ["board", "--out", "x.pdf"]).paper == "a3"
    assert _parse("library", ["build", "a", "b", "--out", "x"]).pitch == (5, 20.5)


def test_what_may_be_repeated_is_replaced_not_added_to(desk):
    write(desk, "[live]\nsend = ['vmc://a:1']\nsource = ['0']")
    command = _parse("live", ["--send", "ws://b:2"])
    assert (command.send, command.source) == (("ws://b:2",), ("0",))


def test_every_option_of_every_command_can_be_set(desk):
    values = {bool: "true", int: "3", float: "0.5", str: "'x'", Path: "'x'"}
    for section in all_sections():
        lines = [f"[{section}]"]
        for option in options_of(load_command(section)).values():
            if choices_of(option.kind):
                continue  # below
            (kind, *_), (least, _) = types_if_given(option.kind), range_of(option.kind)
            many = get_origin(kind) is tuple
            text = values.get(get_args(kind)[0] if many else kind)
            text = f"[{text}]" if many else text if least is None else f"{least}"
            if option.name == "volume":
                text = "[0, 0, 0, 1, 1, 1]"
            assert text is not None, option
            lines.append(f"{option.name} = {text}")
        write(desk, "\n".join(lines))
        assert run(["settings", "--command", section]) == 0
    write(desk, "[fit]\nunit = 'mm'\nsex = 'female'\nrepair = 'off'")
    assert (fitted("--out", "x").unit, fitted("--out", "x").sex) == ("mm", "female")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[fit]\nstatur = 1.7", "[fit] has no setting 'statur': did you mean stature?"),
        ("[fit]\nzzz = 1.7", "[fit] has no setting 'zzz': there are stature, chest"),
        ("[fti]\nstature = 1.7", "there is no section [fti]: did you mean fit?"),
        ("[calibrate.bord]", "there is no section [calibrate.bord]: did you mean board?"),
        ("[calibrate]\npaper = 'a4'", "there is no section [calibrate.paper]: the sections are"),
        ("stature = 1.7", "there is no section [stature]: the sections are demo, studio, fit"),
        ("fit = 3", "fit must be a section: write [fit]"),
        ("[fit]\nstature = 'tall'", "[fit]: stature = 'tall' must be a number"),
        ("[fit]\nstature = true", "[fit]: stature = 'True' must be a number"),
        ("[fit]\ntolerance = 0.5", "[fit]: tolerance = '0.5' must be a whole number"),
        ("[fit]\nsmooth = 1", "[fit]: smooth = '1' must be true or false"),
        ("[fit]\nbody = 92", "[fit]: body = '92' must be text"),
        ("[fit]\nout = 9", "[fit]: out = '9' must be a path, as text"),
        ("[fit]\nsex = 'femal'", "must be one of male, female, unknown: did you mean female?"),
        ("[fit]\nrecording = 'x'", "[fit] has no setting 'recording'"),
        ("[fit]\nsources = 'x'", "[fit] has no setting 'sources'"),
        ("[fit", "no valid TOML"),
    ],
)
def test_a_mistake_in_a_file_is_one_line_and_code_2(desk, capsys, text, line):
    file = write(desk / "lab", text)
    assert run(["fit", "lab/walk"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"voxelpose: {file}: ") and line in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("value", ["1", "'vmc://a:1'", "[1]"])
def test_lists_are_asked_for(desk, capsys, value):
    write(desk, f"[live]\nsend = {value}")
    assert run(["live"]) == 2
    assert "must be a list in brackets, of which each is text" in capsys.readouterr().err


def test_missing_and_wrong_arguments_are_told_as_without_files(desk, capsys):
    write(desk / "lab", "[fit]\nstature = 1.7")
    for words in (["fit", "lab/walk"], ["fit", "lab/walk", "--out", "x", "--colour"], ["fit"]):
        with pytest.raises(SystemExit) as end:
            run(words)
        assert end.value.code == 2
    assert "--out" in capsys.readouterr().err


def test_the_summary_says_which_files_were_in_force(desk):
    write_recording(desk / "walk", ring(2))
    write(desk / "walk", "[fit]\nestimator = 'standing'\npictures = false\nstature = 1.7")
    assert run(["fit", "walk", "--out", "fitted", "--stature", "1.8"]) == 0
    summary = json.loads((desk / "fitted" / "summary.json").read_text())
    assert summary["settings_from"] == dict.fromkeys(
        ("estimator", "pictures"), f"../walk/{SETTINGS_FILE}"
    )
    assert "stature_m = 1.8" in (desk / "fitted" / "settings.toml").read_text()


def test_values_and_where_they_come_from(desk, capsys):
    file = write(desk / "lab", "[fit]\nstature = 1.6\n[calibrate.board]\npaper = 'a3'")
    subject = desk / "lab" / "walk" / "subject.toml"
    subject.write_text("stature = 1.9\nsex = 'female'")
    assert run(["settings", "lab/walk", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert list(shown) == ["fit", "calibrate.board"]
    assert shown["fit"]["stature"] == {"value": 1.6, "from": str(file)}
    assert shown["fit"]["sex"] == {"value": "female", "from": str(Path("lab/walk/subject.toml"))}
    assert shown["fit"]["smooth"] == {"value": True, "from": "default"}
    assert shown["fit"]["out"] == {"value": None, "from": "to be given"}
    assert shown["calibrate.board"]["paper"] == {"value": "a3", "from": str(file)}
    assert run(["settings", "lab/walk", "--command", "calibrate board"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "[calibrate.board]"
    assert f'  paper       "a3"           {file}' in lines


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["nowhere"], "there is no folder nowhere"),
        (["--command", "calibrate bord"], "no such command: did you mean calibrate.board?"),
    ],
)
def test_settings_of_nothing_are_refused(desk, capsys, words, line):
    assert run(["settings", *words]) == 2
    assert line in capsys.readouterr().err
