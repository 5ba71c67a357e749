"""Result folders of several people."""

import csv
import json

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.estimator import Estimate, Settings
from tests.clips import waving
from tests.sources import ring, write_recording
from voxelpose import fitting
from voxelpose.cli import run
from voxelpose.fitting import Output, fit, fit_people
from voxelpose.multiview.people import number_of_people, people_told
from voxelpose.recording.folder import Recording
from voxelpose.results import Result, names_of, open_people


class Crowd:
    """As many people as are asked for, or three."""

    name = "crowd"

    def estimate(self, source, settings, reporter):
        return self.estimate_people(source, settings, reporter, 1)[0]

    def estimate_people(self, source, settings, reporter, people):
        motions = [waving(4, stature) for stature in (1.7, 1.8, 1.6)[:people]]
        return [Estimate(motion.select(np.arange(k, 4))) for k, motion in enumerate(motions)]


@pytest.fixture
def recording(tmp_path, monkeypatch):
    monkeypatch.setattr(fitting, "load_estimator", lambda name: Crowd())
    return Recording.open(write_recording(tmp_path / "walk", ring(2)))


def test_a_result_of_each_person_and_what_shows_them_all(recording, tmp_path):
    out = tmp_path / "out"
    results = fit_people(recording, Output(out))
    assert [result.folder for result in results] == [out / f"person_{k}" for k in (1, 2, 3)]
    assert [len(result.motion) for result in results] == [4, 3, 2]
    assert sorted(path.name for path in out.iterdir()) == [
        *("contact_sheet.png", "joints.csv", "overlay_cam_1.webm", "overlay_cam_2.webm"),
        *("person_1", "person_2", "person_3", "summary.json"),
    ]
    assert sorted(path.name for path in (out / "person_2").iterdir()) == [
        *("calibration.toml", "joints.csv", "motion.bvh", "motion.safetensors"),
        *("settings.toml", "summary.json"),
    ]
    with (out / "joints.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for k, result in enumerate(results, 1):
        listed = [row for row in rows if row["person"] == str(k)]
        joints_m = np.array([[row[f"{axis}_m"] for axis in "xyz"] for row in listed], float)
        np.testing.assert_allclose(joints_m, result.motion.landmarks().reshape(-1, 3), atol=1e-5)
    index = json.loads((out / "summary.json").read_text())
    assert [one["frames"]["with_pose"] for one in index["people"].values()] == [4, 3, 2]
    assert [one.folder for one in open_people(out)] == [one.folder for one in results]


def test_what_is_known_of_each_is_used_and_kept_for_each(recording, tmp_path):
    settings = Settings(1.5, people=people_told("Anna 1.68 female, Ben"))
    results = fit_people(recording, Output(tmp_path / "out", pictures=False), settings)
    known = [(one.settings.get("stature_m"), one.settings["sex"]) for one in results]
    assert known == [(1.68, "female"), (None, "unknown"), (None, "unknown")]
    assert names_of(results) == ["Anna", "Ben", "person_3"]
    assert names_of([Result.open(tmp_path / "out" / "person_2")]) == ["Ben"]
    assert run(["export", str(tmp_path / "out"), "--to", "html"]) == 0
    page = (tmp_path / "out" / "motion.html").read_text(encoding="utf-8")
    assert '"name":"Anna"' in page and '"name":"person_3"' in page


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Anna 168", "--persons Anna 168 = '168.0' must be a number from 0.5 to 2.6 metres"),
        ("Anna 1.6 1.7, Ben", "--persons Anna 1.6 1.7 is not one person: give a name"),
        ("1,2,1,2,1,2,1", "more than 6 people"),
    ],
)
def test_who_cannot_be_is_refused(text, words):
    with pytest.raises(InputError) as refused:
        people_told(text)
    assert words in str(refused.value)


def test_one_person_is_a_result_as_ever(recording, tmp_path):
    (one,) = fit_people(recording, Output(tmp_path / "one", pictures=False), people=1)
    other = fit(recording, Output(tmp_path / "other", pictures=False))
    (opened,) = open_people(one.folder)
    assert opened.folder == one.folder == tmp_path / "one"
    for name in ("joints.csv", "motion.bvh", "motion.safetensors", "settings.toml"):
        assert (one.folder / name).read_bytes() == (other.folder / name).read_bytes()


def test_a_folder_of_several_people_is_no_result_of_one(recording, tmp_path):
    fit_people(recording, Output(tmp_path / "out", pictures=False))
    with pytest.raises(InputError, match=r"holds the results of 3 people: give one .*person_1"):
        Result.open(tmp_path / "out")
    fit_people(recording, Output(tmp_path / "out", True, pictures=False), Settings(), people=2)
    assert len(open_people(tmp_path / "out")) == 2


def test_an_index_that_leads_elsewhere_is_refused(recording, tmp_path):
    fit_people(recording, Output(tmp_path / "out", pictures=False))
    path = tmp_path / "out" / "summary.json"
    (tmp_path / "out" / "person_1").rename(tmp_path / "other")
    path.write_text(path.read_text().replace("person_1", "../other"))
    with pytest.raises(InputError):
        open_people(tmp_path / "out")


def test_an_estimator_of_one_person_is_not_asked_for_two(recording, tmp_path, monkeypatch):
    class Hermit:
        name = "hermit"
        estimate = Crowd.estimate

        def estimate_one(self):
            """Not several."""

    monkeypatch.setattr(fitting, "load_estimator", lambda name: Hermit())
    with pytest.raises(InputError, match="estimates one person, not 2"):
        fit_people(recording, Output(tmp_path / "out"), people=2)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["0", "7", "two", "-1", ""])
def test_numbers_of_people_that_are_refused(text):
    with pytest.raises(InputError, match="--people"):
        number_of_people(text)


def test_numbers_of_people():
    assert [number_of_people(text) for text in ("auto", "1", "6")] == [None, 1, 6]
