"""Uniform backdrops, on small drawn pictures."""

import cv2
import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.empty_scene import EmptyScene

SIZE = (120, 160)
BLUE, GREEN, WHITE, BLACK = (170, 80, 30), (70, 175, 60), (236, 236, 232), (22, 22, 22)
SHIRT, TROUSERS = (60, 70, 170), (110, 90, 120)
ROWS, COLUMNS = np.mgrid[: SIZE[0], : SIZE[1]]


def screen(colour: tuple[int, ...], floor: tuple[int, ...] | None = None) -> np.ndarray:
    """A screen, brighter on the left and darker in the corners, (H, W, 3)."""
    x, y = 2 * COLUMNS / SIZE[1] - 1, 2 * ROWS / SIZE[0] - 1
    light = (1 - 0.1 * x - 0.08 * (x**2 + y**2))[..., None]
    below = (ROWS > 85)[..., None]
    return np.where(below, colour if floor is None else floor, colour) * light


def film(scene: np.ndarray, step: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Frames (20, H, W, 3) of a person who moves an arm and goes a step a frame, and the true
    silhouettes.
    """
    rng = np.random.default_rng(3)
    frames, masks = [], []
    for number in range(20):
        picture, mask = scene.copy(), np.zeros(SIZE, bool)
        left, hand = 65 + step * (number - 10), 30 + 3 * abs(number - 10)
        parts = (slice(25, 65), SHIRT, 0, 22), (slice(65, 105), TROUSERS, 0, 22)
        for rows, colour, first, last in (*parts, (slice(hand, hand + 7), SHIRT, 22, 42)):
            picture[rows, left + first : left + last] = colour
            mask[rows, left + first : left + last] = True
        picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0, 2, picture.shape)
        frames.append(np.rint(picture).clip(0, 255).astype(np.uint8))
        masks.append(mask)
    return np.stack(frames), np.stack(masks)


def agreement(frames: np.ndarray, masks: np.ndarray, kind: str = "auto") -> float:
    """Mean intersection over union of the silhouettes with the true ones."""
    model = BackgroundModel.from_occupied(frames, kind=kind)
    found = np.stack([model.silhouette(frame) for frame in frames[::4]])
    masks = masks[::4]
    return float(((found & masks).sum(axis=(1, 2)) / (found | masks).sum(axis=(1, 2))).mean())


@pytest.mark.parametrize("colour", [BLUE, GREEN, WHITE, BLACK])
@pytest.mark.parametrize("floor", [None, (120, 130, 140)])
def test_a_screen_is_seen_behind_somebody_who_stands_in_place(colour, floor):
    empty = screen(colour, floor)
    frames, masks = film(empty)
    scene = EmptyScene.from_frames(frames)
    assert scene.uniform
    behind = np.abs(scene.mean - empty)[masks.all(axis=0)]
    assert np.median(behind) < 2 and behind.mean() < 5  # the horizon's place is a guess
    assert agreement(frames, masks) > 0.93


def test_estimated_from_movement_the_same_person_is_lost():
    frames, masks = film(screen(BLUE))
    assert not EmptyScene.from_frames(frames, kind="moving").uniform
    assert agreement(frames, masks, "moving") < 0.5


def test_somebody_who_walks_before_a_screen_is_found():
    frames, masks = film(screen(GREEN), step=4)
    assert EmptyScene.from_frames(frames).uniform
    assert agreement(frames, masks) > 0.93


def test_bars_and_a_mark_at_the_border_remain_as_they_are():
    empty = screen(WHITE)
    empty[:, :20] = empty[:, -20:] = 0
    empty[4:9, 26:50] = (30, 30, 200)
    frames, masks = film(empty)
    scene = EmptyScene.from_frames(frames)
    assert scene.uniform
    assert np.abs(scene.mean - empty)[:, :18].max() < 4
    assert np.abs(scene.mean - empty)[5:8, 28:48].max() < 20
    assert agreement(frames, masks) > 0.93


def test_a_wall_with_folds_and_a_panel_in_a_room_are_not_uniform():
    folds = screen(BLUE) + 12 * np.sin(COLUMNS / 4)[..., None]
    assert not EmptyScene.from_frames(film(folds)[0]).uniform
    room = np.random.default_rng(1).uniform(40, 200, (12, 16, 3)).repeat(10, 0).repeat(10, 1)
    room[15:110, 45:115] = screen(GREEN)[15:110, 45:115]
    frames, _ = film(room)
    assert not EmptyScene.from_frames(frames).uniform


def test_who_walks_among_furniture_is_before_no_screen():
    """The rim is plain, but what moves is mostly not before it."""
    furnished = screen(WHITE)
    furnished[24:108, 48:122] = np.random.default_rng(2).uniform(20, 180, (84, 74, 3))
    frames, _ = film(furnished, step=1)
    assert not EmptyScene.from_frames(frames).uniform
    assert EmptyScene.from_frames(frames, kind="uniform").uniform


def test_a_screen_that_fills_half_of_the_picture_is_not_uniform():
    half = screen(BLUE)
    half[:, 100:] = np.random.default_rng(4).uniform(20, 220, (SIZE[0], 60, 3))
    frames, _ = film(half)
    assert not EmptyScene.from_frames(frames).uniform
