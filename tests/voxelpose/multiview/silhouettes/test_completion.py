"""Silhouettes with holes, completed where the other cameras show what is missing."""

import cv2
import numpy as np
import pytest

from tests.voxelpose.multiview.matching_scenes import other_body, photograph, stance, views
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.silhouettes.completion import SilhouetteCompletion

VOLUME = VoxelGrid.from_bounds((-1.0, -1.0, -0.1), (1.0, 1.0, 2.1), 0.05)


@pytest.fixture(scope="module")
def scene() -> tuple[SilhouetteCompletion, list[np.ndarray]]:
    seen_by, body = views(4), other_body()
    pose = stance(body, {"left_upper_arm.abduction": 40.0}, (0.0, 0.0))
    completion = SilhouetteCompletion(seen_by, VOLUME, CarveRule(least_agreeing=3))
    return completion, photograph(seen_by, body, pose)


SHIRT = (0.25, 0.45)  # of the height, from the top


def without_clothes(mask: np.ndarray, part: tuple[float, float] = SHIRT) -> np.ndarray:
    """A silhouette some of whose rows are missing."""
    rows = np.flatnonzero(mask.any(axis=1))
    first, last = np.quantile(rows, part).astype(int)
    holed = mask.copy()
    holed[first:last] = False
    return holed


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    return (first & second).sum() / (first | second).sum()


@pytest.mark.parametrize("holed", [1, 2])
def test_what_other_cameras_show_is_completed(scene, holed):
    completion, truth = scene
    masks = [without_clothes(mask) if c < holed else mask for c, mask in enumerate(truth)]
    result = completion.complete(masks, truth)
    for c, mask in enumerate(truth):
        assert overlap(result[c], mask) > (0.97 if c < holed else 0.999)
        assert c >= holed or overlap(masks[c], mask) < 0.85


def everywhere(masks: list[np.ndarray]) -> list[np.ndarray]:
    return [np.ones_like(mask) for mask in masks]


def test_whole_silhouettes_are_left_alone(scene):
    completion, truth = scene
    given = everywhere(truth)
    for mask, result in zip(truth, completion.complete(truth, given), strict=True):
        assert overlap(mask, result) > 0.97


def test_noise_is_none_of_it(scene):
    completion, truth = scene
    rng = np.random.default_rng(0)
    noise = [cv2.blur(rng.random(mask.shape).astype(np.float32), (9, 9)) > 0.52 for mask in truth]
    assert all(0.15 < pixels.mean() < 0.35 for pixels in noise)
    for mask, result in zip(truth, completion.complete(truth, noise), strict=True):
        assert overlap(mask, result) > 0.98


def test_what_no_camera_may_show_is_not_added(scene):
    completion, truth = scene
    masks = [without_clothes(mask) for mask in truth[:2]] + truth[2:]
    result = completion.complete(masks, masks)
    for mask, completed in zip(masks, result, strict=True):
        np.testing.assert_array_equal(mask, completed)


def test_shadows_beside_the_body_are_not_followed(scene):
    completion, truth = scene
    shadow = np.zeros_like(truth[0])
    shadow[300:312, 20:90] = True
    masks = [truth[0] | shadow, *truth[1:]]
    given = everywhere(truth)
    for mask, result in zip(masks, completion.complete(masks, given), strict=True):
        assert overlap(mask, result) > 0.97
