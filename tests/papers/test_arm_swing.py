"""The arm-swing experiment from recording to files, with few frames."""

import json

import numpy as np
import pytest

from calib.errors import InputError
from papers import arm_swing
from papers.arm_swing import METHODS, Reading, SilhouetteVideo, Truth, near_side, run_methods
from papers.degrade import Degradation
from papers.swing_library import ProfileSettings, swing_library
from papers.swing_study import Study, run_study
from papers.swings import arm_angles, split_swings
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.progress import SilentReporter
from voxelpose.demo.room import make_recording
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth


def test_methods_have_the_papers_names():
    assert [str(method) for method in METHODS] == ["wXOR+DM1", "wXOR+DM2", "nwXOR+DM1", "nwXOR+DM2"]


def test_views_are_about_the_side():
    settings = ProfileSettings(middle_deg=-90, sides=3, yaw_step_deg=8, pitches_deg=(5.0,))
    np.testing.assert_allclose(np.degrees(settings.views()), [(-98, 5), (-90, 5), (-82, 5)])
    assert settings.views_count == 3


@pytest.mark.parametrize(("performance", "near"), [("arm_swing", True), ("far_arm_swing", False)])
def test_mannequin_swings_the_same_way_on_either_side(tmp_path, performance, near):
    recording = Recording.open(make_recording(tmp_path / "film", 2, performance=performance))
    truth = read_truth(tmp_path / "film" / "truth.json")
    assert near_side(truth, recording.rig.cameras[0]) == near
    assert arm_angles(truth)[0] == pytest.approx(-52, abs=1)


@pytest.mark.slow
def test_far_arm_is_occluded_at_times():
    model = BodyModel.from_sizes(BodySizes(1.7))
    library = swing_library(model, near=False, pitch_deg=5.0, samples=120)
    right, left = (
        library.occluded[:, model.names.index(f"{side}_upper_arm")].mean()
        for side in ("right", "left")
    )
    assert 0.2 < right < 0.8
    assert left == 0


@pytest.mark.slow
def test_two_swings(tmp_path):
    recording = Recording.open(make_recording(tmp_path / "film", 48, performance="arm_swing"))
    study = Study(tmp_path / "film" / "truth.json", degraded=False, ours=False, samples=600)
    rows = run_study(recording, study, tmp_path, SilentReporter())
    assert len(split_swings(arm_angles(read_truth(study.truth)))) == 2
    assert [row.method for row in rows] == [str(method) for method in METHODS]
    assert rows[3].counts["success"] == 2
    assert rows[3].error_deg < 20
    assert (tmp_path / "angles.png").exists()
    table = (tmp_path / "table.md").read_text()
    assert "| as found | nwXOR+DM2 | 0 | 0 | 2 | 0 / 10 / 14 |" in table
    about = json.loads((tmp_path / "summary.json").read_text())
    assert about["right_arm"] == "near" and about["rows"][3]["success"] == 2


def test_each_row_has_its_own_distance_and_motion_model(tmp_path, monkeypatch):
    recording = Recording.open(make_recording(tmp_path / "film", 3, performance="arm_swing"))
    model = BodyModel.from_sizes(BodySizes(1.7))
    library = swing_library(model, near=True, pitch_deg=5.0, samples=60)
    made, steps = [], []
    filtered, moved = arm_swing.PaperFilter, arm_swing.transitions
    monkeypatch.setattr(
        arm_swing,
        "PaperFilter",
        lambda *a, **k: made.append(a) or filtered(*a, **k),
    )
    monkeypatch.setattr(
        arm_swing, "transitions", lambda *given: steps.append(given[1]) or moved(*given)
    )
    video = SilhouetteVideo.from_recording(recording, 1.7, SilentReporter())
    truth = Truth(np.linspace(-50, 50, 3), [slice(0, 3)])
    given = [Degradation()], Reading(sigma=0.04), SilentReporter()
    rows = run_methods(video, truth, library, *given)
    assert [given[5] for given in made] == ["wxor", "wxor", "nwxor", "nwxor"]
    assert [given[6] for given in made] == [0.04] * 4 and steps == [False, True, False, True]
    assert [row.paper for row in rows] == [method.paper for method in METHODS]


def test_truth_of_another_recording_is_refused(tmp_path):
    recording = Recording.open(make_recording(tmp_path / "film", 3, performance="arm_swing"))
    make_recording(tmp_path / "other", 2, performance="arm_swing")
    with pytest.raises(InputError, match="give the truth of this recording"):
        run_study(recording, Study(tmp_path / "other" / "truth.json"), tmp_path, SilentReporter())
