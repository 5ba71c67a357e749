"""Light on virtual people."""

import numpy as np
import pytest

from silhouette_core.body.joints import PART_NAMES
from silhouette_core.monocular.making.virtual_shading import (
    bare_pixels,
    lit_labels,
    relative_brightness,
)

NO_PART = np.zeros(len(PART_NAMES), bool)
# Triangles that face up, down, and four ways to the side.
CORNERS = np.array([
    [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [1, 0, 0]],
    [[0, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
    [[0, 0, 0], [0, 0, 1], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
], np.float32)  # fmt: skip
FACES = np.arange(18).reshape(6, 3)


def labels(seed, bare=NO_PART, part=0):
    surface = np.repeat(CORNERS.reshape(1, 18, 3), 3, axis=0)
    return lit_labels(surface, FACES, np.full(6, part), bare, np.random.default_rng(seed))


def test_what_faces_up_is_brightest_on_average():
    found = np.mean([labels(seed)[0] % 62 for seed in range(60)], axis=0)
    up, down, sides = found[0], found[1], found[2:]
    assert up > sides.max() + 3 and sides.min() > down + 2
    assert np.ptp(sides) < 6  # light comes from everywhere


def test_light_stays_where_it_is_and_labels_are_bytes():
    for seed in range(20):
        found = labels(seed)
        assert (found == found[0]).all() and found.min() >= 0 and found.max() < 255


def test_parts_have_the_colours_of_head_clothes_and_shoes():
    bare = np.array([name == "head" for name in PART_NAMES])
    numbers = {
        name: labels(0, bare, PART_NAMES.index(name)).max() // 62
        for name in ("head", "thorax", "left_thigh", "right_foot")
    }
    assert numbers == {"head": 0, "thorax": 1, "left_thigh": 2, "right_foot": 3}
    assert bare_pixels(np.array([[[0, 1, 62, 63, 248]]], np.uint8)).tolist() == [[[0, 1, 1, 0, 0]]]


@pytest.mark.parametrize("seed", range(8))
def test_brightness_is_relative_to_that_of_the_colour(seed):
    rng = np.random.default_rng(seed)
    images = rng.integers(0, 249, (3, 20, 30)).astype(np.uint8)
    relative = relative_brightness(images, rng)
    assert not relative[images == 0].any()
    assert relative[images > 0].mean() == pytest.approx(0, abs=1e-5)
    one = (images > 62) & (images <= 124)
    steps = np.polyfit(images[one].astype(float), relative[one], 1)[0]
    assert steps == pytest.approx(1 / 30, rel=1e-3)
