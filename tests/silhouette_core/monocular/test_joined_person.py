"""Silhouettes in pieces, as before a floor of the trousers' tint."""

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.monocular.joined_person import JoinedPerson, Sample, joined_silhouette
from tests.silhouette_core.monocular.filming import camera_at

HEIGHT, WIDTH = 240, 320
CAMERA = camera_at((0, -4.0, 1.2), size=(WIDTH, HEIGHT))
FLOOR, SHIRT, SKIN = (90, 170, 90), (40, 50, 160), (110, 140, 190)
TROUSERS = tuple(round(0.62 * value) for value in FLOOR)  # as a shadow on the floor


def rectangle(top, bottom, left, right):
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[top:bottom, left:right] = True
    return mask


TRUNK, FEET = rectangle(40, 110, 140, 180), rectangle(190, 204, 140, 180)
LEGS, SHADOW = rectangle(110, 190, 144, 176), rectangle(196, 214, 180, 260)


class Pictures:
    """Six pictures of somebody who steps aside, and of the empty scene before."""

    rig, frame_count, fps, silhouettes_given = Rig((CAMERA,)), 6, 30.0, False

    def __init__(self, trousers):
        self.trousers = trousers

    def backgrounds(self):
        return {CAMERA.name: [self._picture(number, empty=True) for number in range(8)]}

    def regions(self):
        return {}

    def unknown(self):
        return {}

    def at(self, steps):
        return ({CAMERA.name: self._picture(100 + int(step))} for step in steps)

    def __iter__(self):
        for number, frames in enumerate(self.at(range(self.frame_count))):
            yield number, number / self.fps, frames

    def _picture(self, seed, empty=False):
        rng = np.random.default_rng(seed)
        picture = np.empty((HEIGHT, WIDTH, 3))
        picture[:] = FLOOR
        if not empty:
            colours = (SHADOW, TROUSERS), (LEGS, self.trousers), (TRUNK, SHIRT), (FEET, SKIN)
            for mask, colour in colours:
                picture[np.roll(mask, seed - 100, axis=1)] = colour
            picture[np.roll(rectangle(24, 40, 152, 168), seed - 100, axis=1)] = SKIN
        return np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)


def learned(trousers):
    pictures = Pictures(trousers)
    silhouettes = Silhouettes(pictures, ahead=False)
    frames = list(pictures.at(range(pictures.frame_count)))
    samples = [Sample(one, silhouettes.of(one)[CAMERA.name]) for one in frames]
    return silhouettes, frames, JoinedPerson.learned(silhouettes, CAMERA.name, samples)


def share(mask, where):
    return np.count_nonzero(mask & where) / np.count_nonzero(where)


def test_legs_that_look_like_a_shadow_join_the_feet():
    silhouettes, frames, joining = learned(TROUSERS)
    before = silhouettes.of(frames[0])[CAMERA.name]
    assert share(before, TRUNK) > 0.95 and share(before, LEGS) < 0.1
    assert joining is not None
    mask = joining.of(frames[0])
    assert min(share(mask, TRUNK), share(mask, LEGS), share(mask, FEET)) > 0.85
    assert share(mask, SHADOW) < 0.1


def test_whole_silhouettes_are_left_as_they_are():
    assert learned((120, 60, 40))[2] is None


@pytest.mark.parametrize(
    ("differs", "reached"), [(TRUNK | LEGS | FEET, True), (TRUNK | FEET, False)]
)
def test_pieces_are_joined_only_along_what_differs(differs, reached):
    joined = joined_silhouette(TRUNK, FEET, differs)
    assert (share(joined, FEET) == 1.0) == reached
    assert (share(joined, LEGS) > 0.9) == reached
    assert not (joined & ~differs).any()


def test_pieces_close_by_or_far_away_are_others():
    close, away = rectangle(113, 125, 140, 180), rectangle(190, 204, 260, 300)
    assert np.array_equal(joined_silhouette(TRUNK, close, TRUNK | close), TRUNK)
    everywhere = np.ones_like(TRUNK)
    assert np.array_equal(joined_silhouette(TRUNK, away, everywhere), TRUNK)
    assert np.array_equal(joined_silhouette(TRUNK, np.zeros_like(TRUNK), everywhere), TRUNK)


@pytest.mark.parametrize("board", [(190, 230, 120, 200), (190, 196, 100, 220)])
def test_what_is_large_or_wide_is_no_piece(board):
    """A board on the floor, for example."""
    board, everywhere = rectangle(*board), np.ones_like(TRUNK)
    assert np.array_equal(joined_silhouette(TRUNK, board, everywhere), TRUNK)
