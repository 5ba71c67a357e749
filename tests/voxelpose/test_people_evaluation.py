"""Scores of several people, whoever has which number."""

import json

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.estimator import Estimate
from tests.clips import waving
from tests.sources import ring, write_recording
from voxelpose import fitting
from voxelpose.cli.evaluate import Evaluate
from voxelpose.evaluation import evaluate, evaluate_people
from voxelpose.fitting import Output, fit_people
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_people_truth

FIRST, SECOND = waving(6, 1.7), waving(6, 1.6).select(np.arange(2, 6))


class Couple:
    name = "couple"

    def estimate(self, source, settings, reporter):
        return Estimate(FIRST)

    def estimate_people(self, source, settings, reporter, people):
        return [Estimate(FIRST), Estimate(SECOND)]


def truth_of(*motions, moved_m=0.0):
    people = []
    for motion in motions:
        joints = np.full((6, 15, 3), np.nan)
        joints[motion.frames] = motion.landmarks()
        joints[:, 1:] += moved_m
        table = {
            name: [None if np.isnan(place).any() else place.tolist() for place in joints[:, k]]
            for k, name in enumerate(LANDMARK_NAMES)
        }
        people.append({"stature": 1.7, "joints": table})
    return {"unit": "m", "people": people}


@pytest.fixture
def fitted(tmp_path, monkeypatch):
    monkeypatch.setattr(fitting, "load_estimator", lambda name: Couple())
    recording = write_recording(tmp_path / "walk", ring(2))
    fit_people(Recording.open(recording), Output(tmp_path / "out", pictures=False))
    return recording, tmp_path / "out"


def test_everybody_is_scored_against_who_they_are(fitted):
    recording, out = fitted
    (recording / "truth.json").write_text(json.dumps(truth_of(SECOND, FIRST, moved_m=0.01)))
    scores = evaluate_people(out)
    assert [*scores] == ["person_1", "person_2"]
    moved_mm = pytest.approx(10 * np.sqrt(3) * 14 / 15, abs=0.01)
    assert all(score.root_mm == moved_mm and score.lost == 0 for score in scores.values())


def test_the_command_scores_everybody(fitted, capsys):
    recording, out = fitted
    (recording / "truth.json").write_text(json.dumps(truth_of(SECOND, FIRST)))
    Evaluate((out,), json=True).run()
    document = json.loads(capsys.readouterr().out)
    assert [*document] == ["out/person_1", "out/person_2"]
    assert document["out/person_2"]["root_mm"] == pytest.approx(0, abs=0.01)
    Evaluate((out,)).run()
    assert "| out/person_1 | 6 |" in capsys.readouterr().out


def test_who_was_not_found_is_lost(fitted):
    recording, out = fitted
    (recording / "truth.json").write_text(json.dumps(truth_of(waving(6, 1.9), SECOND, FIRST)))
    scores = evaluate_people(out)
    assert [*scores] == ["person_1", "person_2", "nobody_1"]
    assert scores["nobody_1"].lost == 1 and scores["person_2"].lost == 0


def test_truths_that_do_not_fit_are_refused(fitted, tmp_path):
    recording, out = fitted
    truth = recording / "truth.json"
    truth.write_text(json.dumps(truth_of(FIRST)))
    with pytest.raises(InputError, match="holds 2 people, and the truth 1"):
        evaluate_people(out)
    with pytest.raises(InputError, match="is of several people"):
        evaluate(out / "person_1", truth)
    truth.write_text(json.dumps({"joints": {}}))
    with pytest.raises(InputError, match="does not list people"):
        read_people_truth(truth)
    truth.write_text(json.dumps({"people": [3]}))
    with pytest.raises(InputError, match="cannot be read as a truth file"):
        read_people_truth(truth)
