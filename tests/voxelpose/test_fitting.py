"""From frames to a result folder, with an estimator that only stands about."""

import csv
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.estimator import Estimate, Settings, load_estimator
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.progress import SilentReporter
from tests.clips import waving
from tests.sources import ring, write_recording
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.result_documents import summary_document
from voxelpose.results import Result

FILES = ["calibration.toml", "contact_sheet.png", "joints.csv", "motion.bvh", "motion.safetensors"]
FILES += ["overlay_cam_1.webm", "overlay_cam_2.webm", "settings.toml", "summary.json"]


@pytest.fixture
def recording(desk):
    folder = write_recording(desk / "walk", ring(2))
    (folder / "subject.toml").write_text('stature = 1.81\nsex = "female"\n')
    return Recording.open(folder)


def test_result_folder(recording, tmp_path):
    result = fit(recording, Output(tmp_path / "out"), Settings(chest_m=0.9), "standing")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "site", "walk"]
    assert len(result.motion) == 5
    assert result.rig.names == ("cam_1", "cam_2")
    turn = result.rig["cam_2"].rotation
    np.testing.assert_allclose(turn, recording.rig["cam_2"].rotation, atol=1e-6)
    with (tmp_path / "out" / "joints.csv").open(newline="") as file:
        assert {int(row["frame"]) for row in csv.DictReader(file)} == {1, 2, 3, 4, 5}


def test_moments_that_a_camera_lost_are_told_apart_from_those_without_a_pose(recording, tmp_path):
    gap = replace(recording, numbers=np.array([0, 1, 2, 4, 5, 7]))  # 1 to 5 have a pose
    frames = fit(gap, Output(tmp_path / "out", pictures=False), None, "standing").summary["frames"]
    assert frames["lost"] == [0, 7] and frames["not_filmed"] == [3, 6]


def test_moments_in_which_somebody_is_away_are_not_lost(recording):
    found = load_estimator("standing").estimate(recording, Settings(), SilentReporter())
    away = replace(found, absent_frames=frozenset({0, 3}))  # 1 to 5 have a pose
    frames: Any = summary_document(recording, away, "standing", {})["frames"]
    assert frames["lost"] == [] and frames["away"] == [0]


def test_summary_and_settings_say_what_was_done(recording, tmp_path):
    settings = Settings(chest_m=0.9, options={"voxel_size_m": 0.02})
    # Words will do for paths.
    fit(recording, Output(str(tmp_path / "out"), pictures=False), settings, "standing")
    result = Result.open(tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    ends, poses = {"first": 0, "last": 5}, {"with_pose": 5, "lost": [0], "not_filmed": []}
    assert summary["frames"] == ends | poses | {"away": []}
    each = dict.fromkeys(("min", "median", "max", "mean"), 0.002)
    assert summary["seconds"]["stages"]["standing"] == each | {"sum": 0.012}
    assert summary["body"]["stature_m"] == 1.81
    assert summary["quality"]["part_overlap"]["pelvis"] == 0.5
    assert summary["facts"] == {"tried": [0, 1], "fastest_turn": [300.0, 4]}
    assert result.settings["conditioning"] == {
        **{"filter": "auto", "cutoff_hz": 7.0},
        **{"gap_limit": 0, "gap_method": "linear"},
    }
    body = {"stature_m": 1.81, "chest_m": 0.9, "sex": "female"}
    given = body | {"options": {"voxel_size_m": 0.02}, "recording": "../walk"}
    assert {name: result.settings[name] for name in given} == given


class _Notes(SilentReporter):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)


def test_the_summary_states_filter_and_gaps(recording, tmp_path, monkeypatch):
    motion = conditioned(waving(30, fps=50.0).select(np.r_[0:10, 12:25]), Conditioning(gap_limit=2))
    estimator = type(load_estimator("standing"))
    monkeypatch.setattr(estimator, "estimate", lambda *_: Estimate(replace(motion, quality={})))
    result = fit(recording, Output(tmp_path / "out", pictures=False), None, "standing")
    assert result.summary["conditioning"] == {
        "filter": "butterworth",
        "cutoff_hz": 7.0,
        "order": 2,
        "frames_unfiltered": 0,
        "gap_limit_frames": 2,
        "gap_method": "linear",
        "frames_filled": [10, 11],
        "frames_left": 0,
        "words": "Butterworth low-pass, 7 Hz, order 2, forward and backward; 2 missing frames"
        " filled (linear, gaps up to 2 frames)",
    }
    assert result.summary["frames"]["with_pose"] == 23
    short = conditioned(waving(6), Conditioning())
    monkeypatch.setattr(estimator, "estimate", lambda *_: Estimate(short))
    reporter = _Notes()
    fit(recording, Output(tmp_path / "two", pictures=False), None, "standing", reporter)
    assert reporter.notes[-1].startswith("6 of 6 frames are not filtered")


def test_a_bug_leaves_nothing_and_keeps_its_traceback(recording, tmp_path):
    settings = Settings(options={"voxel_size_m": 0.08})
    with pytest.raises(RuntimeError, match="a bug"):
        fit(recording, Output(tmp_path / "out"), settings, "standing")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["site", "walk"]


def test_what_is_no_result_is_not_opened(tmp_path):
    with pytest.raises(InputError, match="is not a result of voxelpose"):
        Result.open(tmp_path)


@pytest.mark.parametrize(("given", "used"), [("auto", "paper"), ("moving", "moving")])
def test_an_estimator_s_usual_background_is_taken_where_none_is_chosen(
    recording, tmp_path, monkeypatch, given, used
):
    estimator, seen = type(load_estimator("standing")), []

    def estimate(self, source, settings, reporter):
        seen.append(settings.background)
        return Estimate(waving(6))

    monkeypatch.setattr(estimator, "usual_background", "paper", raising=False)
    monkeypatch.setattr(estimator, "estimate", estimate)
    output = Output(tmp_path / "out", pictures=False)
    result = fit(recording, output, Settings(background=given), "standing")
    assert seen == [used] and result.settings["background"] == used


@pytest.mark.parametrize(("given", "taken"), [({}, "92A5"), ({"body": "9APP"}, "9APP")])
def test_the_body_of_the_subject_is_taken_where_no_other_is_given(
    recording, tmp_path, monkeypatch, given, taken
):
    class Seen(Exception):
        """What an estimator was told."""

    class Spy:
        takes_body = True

        def estimate(self, source, settings, reporter):
            raise Seen(settings.options)

    monkeypatch.setattr("voxelpose.fitting.load_estimator", lambda name: Spy())
    subject = replace(recording.subject, body="92A5")
    with pytest.raises(Seen, match=taken):
        settings = Settings(options=given)
        fit(replace(recording, subject=subject), Output(tmp_path / "out"), settings, "multiview")
