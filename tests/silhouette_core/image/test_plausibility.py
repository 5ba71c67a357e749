"""Silhouettes that cannot be those of a person are told before any pose is looked for."""

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.plausibility import (
    ImplausibleSilhouettesError,
    check_plausible,
    telling_frames,
)

PERSON = np.zeros((120, 160), bool)
PERSON[20:100, 60:80] = PERSON[30:40, 40:100] = True
WHITE = np.ones((120, 160), bool)
NOISE = np.random.default_rng(3).random((120, 160)) < 0.5
NOBODY, WALL, COLUMN = np.zeros((3, 120, 160), bool)
WALL[10:110, 30:120] = True
COLUMN[:, 70:90] = COLUMN[40:80, 40:120] = True
LARGER = cv2.dilate(PERSON.view(np.uint8), np.ones((15, 15), np.uint8)) > 0


def test_a_person_and_an_empty_view_are_plausible():
    check_plausible({"a": [PERSON, PERSON, NOBODY], "b": [NOBODY] * 3}, least=2)
    with pytest.raises(InputError, match="those of b"):
        check_plausible({"a": [PERSON, PERSON, NOBODY], "b": [WHITE] * 3}, least=2)


@pytest.mark.parametrize(
    ("mask", "words"),
    [(WHITE, "those of b cover 100 % of the picture"), (NOISE, "those of b are specks")],
)
def test_what_cannot_be_a_person_is_named(mask, words):
    masks = {"a": [PERSON] * 3, "b": [mask] * 3}
    check_plausible(masks, least=1)  # the other one will do
    with pytest.raises(InputError, match=words):
        check_plausible(masks, least=2)


def test_the_error_carries_the_masks_at_fault_and_names_their_picture(tmp_path):
    with pytest.raises(ImplausibleSilhouettesError) as caught:
        check_plausible({"a": [PERSON] * 3, "b": [WHITE] * 3}, least=2)
    error = caught.value
    assert list(error.masks) == ["b"] and error.masks["b"][2] is WHITE
    shown = str(error.shown_in(tmp_path / "x.png"))
    assert f"of the picture: see {tmp_path / 'x.png'}, and why with" in shown
    assert shown.endswith("regions/CAMERA.png, or mend the masks")


def test_a_few_bad_moments_are_no_reason():
    check_plausible({"a": [WHITE, PERSON, PERSON]}, least=1)
    with pytest.raises(InputError, match="those of a"):
        check_plausible({"a": [WHITE, WHITE, PERSON]}, least=1)


@pytest.mark.parametrize(
    ("masks", "words"),
    [
        ([WALL] * 6, "those of a fill a rectangle"),
        ([COLUMN] * 6, "those of a go from border to border and never change"),
        ([PERSON, LARGER] * 4, "those of a jump in size from frame to frame"),
        ([PERSON, NOBODY] * 4, "those of a jump in size from frame to frame"),
    ],
)
def test_walls_and_flicker_are_no_person(masks, words):
    with pytest.raises(InputError, match=f"{words}: look at them with `voxelpose setup`"):
        check_plausible({"a": masks}, least=1)
    check_plausible({"a": masks}, least=1, person=False)


@pytest.mark.parametrize(
    "masks",
    [
        [PERSON] * 16,
        [COLUMN] * 4,  # two moments are too few to tell
        [np.roll(COLUMN, x, axis=1) for x in range(8)],
        [NOBODY] * 10 + [PERSON, LARGER] + [PERSON] * 4,
    ],
)
def test_somebody_who_stands_still_or_is_cut_off_is_plausible(masks):
    assert check_plausible({"a": masks}, least=1) is None


@pytest.mark.parametrize("count", [1, 2, 5, 400])
def test_every_moment_has_the_frame_after_it(count):
    frames = telling_frames(count)
    assert frames == sorted(frames) and max(frames) < count
    steps = [b - a for a, b in zip(frames[::2], frames[1::2], strict=True)]
    assert steps[:-1] == [1] * (len(steps) - 1)
