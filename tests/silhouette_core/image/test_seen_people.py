from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from silhouette_core.image import seen_people
from silhouette_core.image.pose_network import Crop, PersonSeen
from silhouette_core.image.seen_people import (
    SeenPeople,
    network_for,
    people_looked_for,
    people_masks,
    people_odds,
)
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.image.drawn_people import BrightPeople, picture


@pytest.fixture
def people(monkeypatch, tmp_path):
    monkeypatch.setattr(seen_people, "PoseNetwork", lambda path: BrightPeople())
    return SeenPeople(["cam_1", "cam_2"], tmp_path)


def test_what_is_seen_is_read_as_it_was_written(people):
    rng = np.random.default_rng(0)
    person = PersonSeen(
        Crop(10.5, 20.25, 64.0, 0.5),
        0.75,
        rng.integers(-127, 128, (256, 256)).astype(np.int8),
        rng.normal(size=(33, 2)).astype(np.float32),
        rng.random(33).astype(np.float32),
        rng.normal(size=(2, 2)).astype(np.float32),
    )
    people._numbers["cam_2", 3] = []
    people.put("cam_2", 3, 1, person)
    (read,) = people.of("cam_2", 3).values()
    assert read.crop == person.crop and read.presence == person.presence
    for name in ("logits", "points_px", "visibility", "circle_px"):
        np.testing.assert_array_equal(getattr(read, name), getattr(person, name))
    assert people.of("cam_1", 3) == {}


def test_each_camera_is_followed_for_itself(people):
    for step in range(4):
        people.look(step, {"cam_1": picture((60 + 10 * step, 60, 30, 90)), "cam_2": picture()})
    assert [len(people.of("cam_1", step)) for step in range(4)] == [1] * 4
    assert not any(people.of("cam_2", step) for step in range(4))


def test_somebody_who_is_elsewhere_after_skipped_frames_is_found_at_once(people):
    for step in (0, 20):  # as samples are looked at, and then all frames
        people.look(step, {"cam_1": picture((40 + 10 * step, 60, 30, 90))})
    people.look(1, {"cam_1": picture((40, 130, 20, 60))})
    assert people.count("cam_1", 1) == 1 and people.count("cam_2", 1) == 0


@pytest.mark.parametrize(
    ("smooth", "names"), [(True, ["cam_1", "cam_2"]), (False, ["cam_2"])], ids=["later", "causal"]
)
def test_of_previous_frames_alone_cameras_without_an_empty_view_are_asked(
    people, monkeypatch, tmp_path, smooth, names
):
    monkeypatch.setattr(seen_people, "installed_network", lambda use: tmp_path)
    source = SimpleNamespace(
        rig=SimpleNamespace(names=("cam_1", "cam_2")),
        silhouettes_given=False,
        backgrounds=lambda: {"cam_1": ()},
    )
    asked = people_looked_for(source, Settings(smooth=smooth), SilentReporter())
    assert list(asked.windows) == names
    asked.look(0, {"cam_1": picture(), "cam_2": picture((100, 60, 30, 90))})
    assert asked.count("cam_2", 0) == 1 and not asked.of("cam_1", 0)
    source.backgrounds = lambda: {"cam_1": (), "cam_2": ()}
    assert (people_looked_for(source, Settings(smooth=smooth), SilentReporter()) is None) != smooth


@pytest.mark.parametrize(
    ("missing", "use", "told"), [("a", "auto", 1), ("", "auto", 0), ("a", "off", 0)]
)
def test_what_a_network_would_help_is_said_where_there_is_none(monkeypatch, missing, use, told):
    monkeypatch.setattr(seen_people, "installed_network", lambda use: None)
    notes, reporter = [], SilentReporter()
    reporter.note = notes.append
    assert network_for([*missing], use, reporter) is None
    assert len(notes) == told and all("voxelpose network install" in note for note in notes)


def test_each_pixel_is_the_likeliest_persons():
    frame = picture((100, 60, 30, 90), (130, 60, 30, 90))
    looks = BrightPeople()
    left = looks.look(frame * (np.arange(320) < 130)[:, None].astype(np.uint8), Crop(115, 105, 120))
    both = looks.look(frame, Crop(130, 105, 120))
    assert people_masks({}, 1.0, (320, 240)) == []
    first, second = people_masks({0: left, 3: both}, 1.0, (320, 240))
    assert first[100, 115] and not second[100, 115] and second[100, 145]
    assert not (first & second).any()


def test_odds_are_the_surest_persons_and_nothing_where_nobody_is_seen():
    assert not people_odds({}, 1.0, (32, 24)).any()
    seen = BrightPeople().look(picture((100, 60, 30, 90)), Crop(115, 105, 120))
    odds = people_odds({0: seen}, 0.5, (160, 120))
    assert odds.shape == (120, 160)
    assert odds[52, 57] > 2 and odds[10, 10] < -5
