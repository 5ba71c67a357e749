"""Silhouettes with holes, completed where the other cameras show what is missing."""

import numpy as np
import pytest

from tests.voxelpose.matching.matching_scenes import other_body, photograph, stance, views
from voxelpose.carving.carver import CarveRule
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.completion import SilhouetteCompletion

VOLUME = VoxelGrid.from_bounds((-1.0, -1.0, -0.1), (1.0, 1.0, 2.1), 0.05)


@pytest.fixture(scope="module")
def scene() -> tuple[SilhouetteCompletion, list[np.ndarray]]:
    seen_by, body = views(4), other_body()
    pose = stance(body, {"left_upper_arm.abduction": 40.0}, (0.0, 0.0))
    completion = SilhouetteCompletion(seen_by, VOLUME, CarveRule(least_agreeing=3))
    return completion, photograph(seen_by, body, pose)


def without_shirt(mask: np.ndarray) -> np.ndarray:
    """A silhouette whose rows of the chest are missing."""
    rows = np.flatnonzero(mask.any(axis=1))
    first, last = np.quantile(rows, [0.25, 0.45]).astype(int)
    holed = mask.copy()
    holed[first:last] = False
    return holed


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    return (first & second).sum() / (first | second).sum()


@pytest.mark.parametrize("holed", [1, 2])
def test_what_other_cameras_show_is_completed(scene, holed):
    completion, truth = scene
    masks = [without_shirt(mask) if c < holed else mask for c, mask in enumerate(truth)]
    result = completion.complete(masks, truth, truth)
    for c, mask in enumerate(truth):
        assert overlap(result[c], mask) > (0.97 if c < holed else 0.999)
        assert c >= holed or overlap(masks[c], mask) < 0.85


def test_whole_silhouettes_are_left_alone(scene):
    completion, truth = scene
    everywhere = [np.ones_like(mask) for mask in truth]
    for mask, result in zip(truth, completion.complete(truth, everywhere, everywhere), strict=True):
        assert overlap(mask, result) > 0.97


def test_what_no_camera_may_show_is_not_added(scene):
    completion, truth = scene
    masks = [without_shirt(mask) for mask in truth[:2]] + truth[2:]
    result = completion.complete(masks, masks, masks)
    for mask, completed in zip(masks, result, strict=True):
        np.testing.assert_array_equal(mask, completed)


def test_shadows_beside_the_body_are_not_followed(scene):
    completion, truth = scene
    shadow = np.zeros_like(truth[0])
    shadow[300:312, 20:90] = True
    masks = [truth[0] | shadow, *truth[1:]]
    everywhere = [np.ones_like(mask) for mask in truth]
    for mask, result in zip(masks, completion.complete(masks, everywhere, everywhere), strict=True):
        assert overlap(mask, result) > 0.97


@pytest.mark.parametrize("count", [4, 6])
def test_what_may_be_a_shadow_in_one_camera_is_outvoted(count):
    seen_by, body = views(count), other_body()
    truth = photograph(seen_by, body, stance(body, {}, (0.0, 0.0)))
    masks = [without_shirt(truth[0]), *truth[1:]]
    completion = SilhouetteCompletion(seen_by, VOLUME, CarveRule(least_agreeing=3))
    result = completion.complete(masks, masks, truth)
    assert overlap(result[0], truth[0]) > 0.9 > 0.8 > overlap(masks[0], truth[0])
