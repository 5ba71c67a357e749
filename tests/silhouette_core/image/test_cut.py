"""Silhouettes by a minimum cut: colours and edges beside the background."""

import cv2
import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.cut import _ROUNDS, least_cut
from silhouette_core.image.exposure import Aligner
from tests.oracles.image import least_cost_labels
from tests.silhouette_core.image.drawn_figures import agreements, noisy

SIZE = (240, 320)
SKIN, SHIRT, TROUSERS = (90, 120, 190), (90, 140, 110), (120, 60, 40)


def walk(
    wall: np.ndarray, places: range, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Frames (T, H, W, 3) of a figure before a wall, and its silhouettes (T, H, W)."""
    frames, masks = [], []
    for left in places:
        picture, mask = wall.astype(float), np.zeros(SIZE, np.uint8)
        for (top, bottom), colour in (((60, 85), SKIN), ((85, 140), SHIRT), ((140, 210), TROUSERS)):
            picture[top:bottom, left : left + 36] = colour
            mask[top:bottom, left : left + 36] = 1
        frames.append(noisy(cv2.GaussianBlur(picture, (0, 0), 0.7), rng, 2))
        masks.append(mask.astype(bool))
    return np.stack(frames), np.stack(masks)


def agreement(frames: np.ndarray, masks: np.ndarray) -> float:
    """Least intersection over union of the silhouettes with the true ones."""
    return float(agreements(BackgroundModel.from_occupied(frames), frames, masks).min())


def test_a_white_screen_between_black_bars_is_no_person():
    wall = np.zeros((*SIZE, 3))
    wall[:, 90:230] = 255
    frames, masks = walk(wall, range(100, 180, 4), np.random.default_rng(1))
    assert agreement(frames, masks) > 0.93


def test_clothes_of_the_walls_colour_belong_to_who_wears_them():
    wall = np.full((*SIZE, 3), (200.0, 205, 210))
    wall[:, 200:220] = SHIRT  # a panel of the shirt's colour
    frames, masks = walk(wall, range(20, 270, 10), np.random.default_rng(2))
    assert agreement(frames, masks) > 0.8


def test_beside_an_empty_view_colours_close_holes():
    rng = np.random.default_rng(4)
    wall = np.full((*SIZE, 3), (200.0, 205, 210))
    wall[:, 150:230] = np.array(SHIRT) + 10  # a wide panel, nearly of the shirt's colour
    frames, masks = walk(wall, range(20, 270, 10), rng)
    soft = cv2.GaussianBlur(wall, (0, 0), 0.7)
    plain = BackgroundModel.from_frames(noisy(soft, rng, 2) for _ in range(8))
    least = agreements(plain, frames, masks).min()
    assert agreements(plain.with_colours(frames[::2]), frames, masks).min() > max(0.9, least + 0.1)


def test_a_cast_shadow_is_no_person():
    wall = np.full((*SIZE, 3), (150.0, 170, 160))
    rng = np.random.default_rng(3)
    frames, masks = walk(wall, range(20, 250, 9), rng)
    for frame, mask in zip(frames, masks, strict=True):
        columns = np.flatnonzero(mask.any(axis=0))
        part = slice(205, 225), slice(columns[0] + 10, columns[-1] + 30)
        shadow, lit = frame[part], ~mask[part]
        shadow[lit] = (0.6 * shadow[lit]).astype(np.uint8)
    assert agreement(frames, masks) > 0.9


@pytest.mark.parametrize("size", [(6, 8), (9, 5), (1, 4)])
def test_a_cut_is_belief_propagation_with_two_labels(size):
    rng = np.random.default_rng(4)
    odds = rng.normal(0, 2, size).astype(np.float32)
    links = rng.uniform(0, 2, (2, *size)).astype(np.float32)
    own, differ = np.stack([np.zeros(size), -odds], axis=2), 1 - np.eye(2)
    labels = np.empty(size, int)
    right, down = (link[..., None, None] * differ for link in links)
    least_cost_labels(own, right, down, _ROUNDS, labels)
    assert np.array_equal(least_cut(odds, links), labels == 1)


@pytest.mark.parametrize("seed", range(3))
def test_an_exposure_that_varies_over_the_picture_is_taken_out(seed):
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[-1 : 1 : SIZE[0] * 1j, -1 : 1 : SIZE[1] * 1j]
    room = cv2.GaussianBlur(rng.uniform(60, 180, (*SIZE, 3)), (0, 0), 9)
    terms = rng.uniform(-0.08, 0.08, (3, 3))
    field = np.exp(terms[0] + columns[..., None] * terms[1] + rows[..., None] * terms[2])
    frame = np.rint(room * field).clip(0, 255).astype(np.uint8)
    frame[80:200, 120:160] = SHIRT  # somebody
    off = np.abs(Aligner(room.astype(np.float32)).aligned(frame).astype(float) - room)
    off[75:205, 115:165] = 0
    assert off.mean() < 1 < np.abs(frame - room)[:, :100].mean()


def test_a_black_stage_keeps_its_exposure_whoever_is_lit_on_it():
    rng = np.random.default_rng(5)
    stage = rng.normal(12, 1, (*SIZE, 3)).clip(0, 255)
    reference = stage.copy()
    reference[60:200, 130:170] = (40, 160, 190)  # who is there most of the time
    frame = np.rint(stage).astype(np.uint8)
    frame[60:200, 130:170] = np.linspace(60, 220, 140)[:, None, None]  # somebody lit from below
    off = Aligner(reference.astype(np.float32)).aligned(frame).astype(float) - stage
    off[55:205, 125:175] = 0
    assert np.abs(off).max() < 6
