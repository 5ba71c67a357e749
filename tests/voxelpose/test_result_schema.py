"""summary.json and settings.toml are checked when a result is opened, and the entry is named."""

import copy
import json

import pytest

from calib.errors import InputError
from tests.clips import FIRST_SUMMARY
from voxelpose.results import load_settings, load_summary


def changed(path: str, value: object) -> dict:
    content = copy.deepcopy(FIRST_SUMMARY)
    *way, last = path.split("/")
    inner = content
    for key in way:
        inner = inner[key]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return content


def test_a_summary_of_the_first_version_is_read(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(FIRST_SUMMARY))
    assert load_summary(tmp_path / "summary.json") == FIRST_SUMMARY | {"facts": {}}


def test_unknown_entries_are_kept_and_unknown_facts_left_out(tmp_path):
    facts = {"half_turn_ratio": None, "seams_mm": [None, 3.0], "other": {"a": [1]}}
    (tmp_path / "summary.json").write_text(json.dumps(FIRST_SUMMARY | {"new": 1, "facts": facts}))
    summary = load_summary(tmp_path / "summary.json")
    del facts["half_turn_ratio"]
    assert summary["new"] == 1 and summary["facts"] == facts


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("frames", None, "missing required field frames"),
        ("frames/lost", ["x"], "Expected int, got str - at frames.lost"),
        ("frames/with_pose", -1, "at frames.with_pose"),
        ("frames/with_pose", 10**30, "at frames.with_pose"),
        ("fps", 0.0, "at fps"),
        ("cameras", [], "at cameras"),
        ("body/stature_m", 1e308, "at body.stature_m"),
        ("quality/unexplained/max", None, "quality.unexplained lacks min, median or max"),
        ("seconds/stages/hulls/median", 1.0, "seconds.stages.hulls lacks min, median or max"),
        ("seconds/total", float("nan"), "at seconds.total"),
        ("facts", {"seams_mm": 3}, "at facts.seams_mm"),
        ("findings", [{"about": "Frames", "level": "fine", "words": ""}], "at findings[0].level"),
        ("verdict", {"level": "fine"}, "at verdict.level"),
        ("recording", "a\x00b", "at recording"),
    ],
)
def test_a_damaged_summary_names_the_entry(tmp_path, path, value, words):
    (tmp_path / "summary.json").write_text(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match=r"summary\.json: .*: fit again, or put") as error:
        load_summary(tmp_path / "summary.json")
    assert words in str(error.value) and "\n" not in str(error.value)


def test_settings_of_any_version_are_read(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("")
    assert load_settings(path) == {}
    path.write_text('recording = "../walk"\nframes = [0, 9]\nnew = 1\n[options]\nrepair = "auto"\n')
    assert load_settings(path)["options"] == {"repair": "auto"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("recording = 3", "Expected str, got int - at recording"),
        (f'recording = "{"x" * 300}"', "recording is no folder's name"),
        ('recording = "a\\u0000b"', "at recording"),
        ("frames = [0, 1000000000000]", "at frames"),
        ("frames = [5, 3]", "frames [5, 3] end before they begin"),
        ('background = "green"', "at background"),
        ("[options]\nvoxel_size_m = 1e-300", "at options.voxel_size_m"),
        ('[options]\ntolerance = "x"', "at options.tolerance"),
        ('cameras = ["a", "b"]\n[options]\ntolerance = 65', "is more than 2 cameras allow"),
        ("threads = 0", "at threads"),
        (f"stature_m = {'9' * 5000}", "no valid TOML"),
        (f"stature_m = {'9' * 400}", "stature_m"),
    ],
)
def test_damaged_settings_name_the_entry(tmp_path, text, words):
    (tmp_path / "settings.toml").write_text(text)
    with pytest.raises(InputError, match=r"settings\.toml: ") as error:
        load_settings(tmp_path / "settings.toml")
    assert words in str(error.value) and "\n" not in str(error.value)
