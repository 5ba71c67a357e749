import numpy as np
import pytest

from silhouette_core.image import seen_people
from silhouette_core.image.pose_network import Crop, PersonSeen
from silhouette_core.image.seen_people import SeenPeople, people_odds
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
        left = 60 + 10 * step
        people.look(step, {"cam_1": picture((left, 60, 30, 90)), "cam_2": picture()})
    assert [len(people.of("cam_1", step)) for step in range(4)] == [1] * 4
    assert not any(people.of("cam_2", step) for step in range(4))


def test_the_person_of_a_silhouette_is_who_shares_most_of_it(people):
    frame = np.maximum(picture((40, 60, 30, 90)), picture((240, 60, 30, 90)))
    people.look(0, {"cam_1": frame})
    mask = picture((230, 50, 50, 100))[..., 0] > 0
    assert people.nearest("cam_1", 0, mask).box_px.mean(axis=0)[0] > 200
    half = mask[::2, ::2]  # of half the size
    assert people.nearest("cam_1", 0, half).box_px.mean(axis=0)[0] > 200
    assert people.nearest("cam_1", 0, np.zeros_like(mask)) is None


def test_odds_are_the_surest_persons_and_nothing_where_nobody_is_seen():
    assert not people_odds({}, 1.0, (32, 24)).any()
    looks = BrightPeople()
    seen = looks.look(picture((100, 60, 30, 90)), Crop(115, 105, 120))
    odds = people_odds({0: seen}, 0.5, (160, 120))
    assert odds.shape == (120, 160)
    assert odds[52, 57] > 2 and odds[10, 10] < -5
