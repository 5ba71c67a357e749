"""Defects of virtual silhouettes: how often, how long, and where."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from silhouette_core.monocular.making import virtual_defects
from silhouette_core.monocular.making.virtual_defects import (
    cast_shadow,
    passing_defects,
    spoil_silhouettes,
    wall_coloured_places,
)


def moving_places(frames=20_000):
    """Five vertices that move a pixel a frame, 100 px apart."""
    steps = np.arange(frames, dtype=float)[:, None]
    return np.stack([steps + 100 * np.arange(5), np.zeros((frames, 5))], axis=2)


def test_passing_defects_come_in_a_third_of_the_frames_and_last():
    edges, discs = passing_defects(moving_places(), np.random.default_rng(0))
    spoiled = (edges != 0) | (discs[..., 2] != 0).any(axis=1)
    assert 0.2 < spoiled.mean() < 0.35
    changes = np.count_nonzero(np.diff(discs[..., 2].sum(axis=1)))
    assert changes < 0.25 * spoiled.sum()


def test_holes_follow_the_body_and_what_is_strange_lies_beside_it():
    places = moving_places()
    _, discs = passing_defects(places, np.random.default_rng(0))
    away = np.linalg.norm(discs[:, :, None, :2] - places[:, None], axis=-1).min(axis=-1)
    radius = discs[..., 2]
    assert away[radius > 0].max() < 1e-2 and radius.max() > 12
    assert 3 < np.median(away[radius < 0]) < 12 and radius.min() < -8
    _, holes = passing_defects(places, np.random.default_rng(0), strange=False)
    assert holes[..., 2].min() == 0 and holes[..., 2].max() > 12


def test_silhouettes_grow_or_shrink_and_discs_are_erased_in_turn():
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(6, 12, 17))
    masks = np.stack([cv2.GaussianBlur(image, (0, 0), 1.5) > 0 for image in noise]).astype(np.uint8)
    discs = np.concatenate([rng.uniform(-3, 18, (6, 3, 2)), rng.uniform(-2, 5, (6, 3, 1))], axis=2)
    edges = np.array([-1, 0, 1, -1, 0, 1], np.int8)
    expected, (y, x) = masks.copy(), np.indices(masks.shape[1:])
    for mask, edge, changed in zip(expected, edges, discs, strict=True):
        if edge:
            before = mask == (edge > 0)
            mask[1:, 1:][before[:-1, 1:] | before[1:, :-1]] = edge > 0
        for u, v, radius in changed[changed[:, 2] != 0]:
            mask[(x - u) ** 2 + (y - v) ** 2 <= radius**2] = radius < 0
    spoil_silhouettes(masks, edges, discs)
    np.testing.assert_array_equal(masks, expected)


def test_places_of_one_colour_are_missing_in_some_takes():
    places, colour = moving_places(200), np.array([0, 0, 1, 1, 1])
    takes = [
        wall_coloured_places(places, colour, np.random.default_rng(seed)) for seed in range(400)
    ]
    missing = [take for take in takes if (take[..., 2] > 0).any()]
    assert 0.1 < len(missing) / len(takes) < 0.2
    both = set()
    for take in missing:
        vertex = np.rint((take[..., 0] - places[:, :1, 0]) / 100).astype(int)
        colours = np.unique(colour[vertex[take[..., 2] > 0]])
        assert len(colours) == 1 and (vertex == vertex[0]).all()
        both.update(colours.tolist())
        assert 0.3 < np.mean(take[..., 2] > 0) <= 1
    assert both == {0, 1}


def test_shadows_lie_on_the_floor_at_the_feet(monkeypatch):
    surface = np.zeros((2, 3, 3), np.float32)
    surface[:, 1:, 2] = 0.05, 1.0  # a foot and the head above it
    assert any(cast_shadow(surface, np.random.default_rng(seed)) is None for seed in range(9))
    always = replace(virtual_defects.DEFECTS, shadowed=1.0)
    monkeypatch.setattr(virtual_defects, "DEFECTS", always)
    lengths = []
    for seed in range(50):
        shadow = cast_shadow(surface, np.random.default_rng(seed))
        assert shadow is not None and not shadow[..., 2].any() and not shadow[:, 0].any()
        foot, head = np.linalg.norm(shadow[0, 1:, :2], axis=1)
        assert head >= foot > 0
        lengths.append(head)
    assert max(lengths) < 1.1 * 1 / np.tan(np.radians(35)) and min(lengths) < 0.3


@pytest.mark.parametrize("frames", [1, 7])
def test_short_takes_are_spoiled_as_well(frames):
    edges, discs = passing_defects(moving_places(frames), np.random.default_rng(3))
    assert edges.shape == (frames,) and len(discs) == frames
