from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.image.person_windows import PeopleWindows, next_crop, same_person, squares
from silhouette_core.image.pose_network import Crop
from tests.silhouette_core.image.drawn_people import BrightPeople, picture


def centres(people):
    return {number: seen.box_px.mean(axis=0) for number, seen in people.items()}


def test_somebody_is_followed_across_the_picture():
    windows = PeopleWindows(BrightPeople())
    for step in range(12):
        people = windows.see(picture((20 + 18 * step, 60, 30, 90)))
        assert list(people) == [0]
        np.testing.assert_allclose(centres(people)[0], (34.5 + 18 * step, 104.5), atol=3)


def test_following_costs_one_look_and_now_and_then_one_for_others():
    network = BrightPeople()
    windows = PeopleWindows(network, most=2)
    windows.see(picture((100, 60, 30, 90)))
    before = network.looks
    for step in range(12):
        windows.see(picture((100 + 2 * step, 60, 30, 90)))
    assert network.looks - before == 12 + 12 / 4


def test_two_people_keep_their_numbers_while_they_move():
    windows = PeopleWindows(BrightPeople(), most=2)
    first = centres(windows.see(picture((40, 60, 30, 90), (220, 70, 30, 90))))
    for step in range(8):
        frame = picture((40 + 5 * step, 60, 30, 90), (220 - 5 * step, 70, 30, 90))
        people = centres(windows.see(frame))
    assert set(people) == set(first) == {0, 1}
    for number, centre in people.items():
        assert abs(centre[0] - first[number][0]) == pytest.approx(35, abs=4)


def test_who_leaves_is_not_seen_and_comes_back_under_the_same_number():
    windows = PeopleWindows(BrightPeople())
    windows.see(picture((100, 60, 30, 90)))
    assert all(windows.see(picture()) == {} for _ in range(10))
    for _ in range(12):
        people = windows.see(picture((100, 60, 30, 90)))
    assert list(people) == [0]


def test_who_appears_later_is_found():
    windows = PeopleWindows(BrightPeople())
    for _ in range(3):
        assert windows.see(picture()) == {}
    assert [windows.see(picture((250, 130, 20, 60))) for _ in range(40)][-1]


def test_people_who_touch_are_followed_each():
    """The network sees either of two who overlap, unless the other one is painted out."""
    windows = PeopleWindows(BrightPeople(), most=2)
    for step in range(24):
        left, right = 40 + 4 * step, 220 - 4 * step
        people = windows.see(picture((left, 60, 30, 90), (right, 60, 30, 90)))
        if abs(left - right) > 24:
            assert list(people) == [0, 1]
    assert right - left < 30


def test_two_windows_never_hold_the_same_person():
    windows = PeopleWindows(BrightPeople(), most=2)
    windows.see(picture((60, 60, 30, 90), (200, 60, 30, 90)))
    for left in range(60, 201, 10):
        people = windows.see(picture((left, 60, 30, 90)))
    assert len(people) == 1


def test_the_next_square_holds_the_person_and_a_margin():
    seen = BrightPeople().look(picture((100, 60, 30, 90)), Crop(160, 120, 320))
    crop = next_crop(seen)
    assert crop.side_px == pytest.approx(1.25 * 90, rel=0.05)
    assert (crop.x_px, crop.y_px) == pytest.approx((114.5, 104.5), abs=2)
    assert same_person(seen, BrightPeople().look(picture((100, 60, 30, 90)), crop))


@pytest.mark.parametrize("size", [(320, 240), (240, 320), (1920, 400), (300, 300)])
def test_squares_reach_every_person_wholly(size):
    rng = np.random.default_rng(5)
    crops = list(squares(*size))
    for _ in range(50):
        height = rng.uniform(0.15, 0.3) * size[1]
        x, y = rng.uniform((height / 2,) * 2, np.array(size) - height / 2)
        assert any(
            abs(x - crop.x_px) <= crop.side_px / 2 - 0.25 * height
            and abs(y - crop.y_px) <= crop.side_px / 2 - 0.49 * height
            for crop in crops
        )


def test_what_never_moves_and_is_doubtful_is_a_thing():
    windows, thing = PeopleWindows(BrightPeople()), picture((40, 60, 30, 90), value=150)
    assert not any(windows.see(thing) for _ in range(40))
    for step in range(12):  # until it moves
        people = windows.see(picture((40 + 12 * step, 60, 30, 90), value=150))
    assert len(people) == 1


def test_what_is_sure_from_one_square_alone_is_nobody():
    class OneSquare(BrightPeople):
        """Sure of what is looked at for the first time alone."""

        sides = ()

        def look(self, picture, crop, others=None):
            seen = super().look(picture, crop, others)
            again = any(abs(crop.side_px - side) < 15 for side in self.sides)
            self.sides = (*self.sides, crop.side_px) if crop.side_px < 200 else self.sides
            return replace(seen, presence=0.2 if again else seen.presence)

    assert PeopleWindows(OneSquare()).see(picture((100, 60, 30, 90))) == {}


def test_a_square_in_which_nobody_is_likely_is_looked_at_once():
    class Unlikely(BrightPeople):
        def look(self, picture, crop, others=None):
            return replace(super().look(picture, crop, others), presence=0.2)

    network = Unlikely()
    assert PeopleWindows(network).see(picture((100, 60, 30, 90))) == {}
    assert network.looks == len([*squares(320, 240)])
