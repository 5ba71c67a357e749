"""Carving with pixels about which nothing is known."""

import numpy as np
import pytest
from carving_scenes import figure_points, ring, rule_numbers, silhouettes

from tests.oracles import carving as reference
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.carver import CarveRule, carve, pack_rig
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels.blocks import BLIND

PERSON = VoxelGrid.from_bounds((-0.9, -0.7, -0.1), (0.95, 0.7, 1.95), 0.045)
RIG = ring(4)
MASKS = list(silhouettes(RIG).values())


def lower_part(camera: int, share: float = 0.6) -> list[np.ndarray]:
    """Unknown places: the lower part of one camera's picture."""
    unknown = [np.zeros_like(mask) for mask in MASKS]
    unknown[camera][round((1 - share) * len(unknown[camera])) :] = True
    return unknown


def hidden(unknown: list[np.ndarray]) -> list[np.ndarray]:
    return [mask & ~where for mask, where in zip(MASKS, unknown, strict=True)]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rule", [CarveRule(), CarveRule(1, 2), CarveRule(0, 0), CarveRule(2)])
def test_carving_is_the_references(seed, rule):
    rng = np.random.default_rng(seed)
    unknown = [np.zeros_like(mask) for mask in MASKS]
    for where in unknown[: 1 + seed % 3]:
        row, column = rng.integers(0, 80, 2)
        where[row : row + 50, column : column + 60] = True
    rows, kinds, _ = pack_rig(RIG)
    pixels = [
        np.where(where, BLIND, mask).astype(np.uint8)
        for mask, where in zip(MASKS, unknown, strict=True)
    ]
    expected = reference.carve_voxels(rows, kinds, pixels, rule_numbers(rule, 4), PERSON.axes())
    np.testing.assert_array_equal(carve(RIG, MASKS, PERSON, rule, unknown), expected)


def test_what_is_hidden_from_one_camera_is_not_carved_by_it():
    unknown = lower_part(0)
    rule = CarveRule(0, 3)
    whole = carve(RIG, MASKS, PERSON, rule)
    without = carve(RIG, hidden(unknown), PERSON, rule)
    found = carve(RIG, hidden(unknown), PERSON, rule, unknown)
    assert without.sum() < 0.7 * whole.sum()
    assert (whole & ~found).sum() == 0
    three = carve(RIG.select(RIG.names[1:]), MASKS[1:], PERSON, rule)
    assert (found & ~three).sum() == 0  # what the others do not see is no part of it


def test_the_volume_holds_what_is_hidden():
    unknown = lower_part(0)
    points = figure_points()
    rule = CarveRule(least_agreeing=3)
    grid = place_grid(RIG, hidden(unknown), 0.05, rule=rule, unknown=unknown)
    low, high = grid.origin_m, grid.origin_m + grid.size_m
    assert (points.min(0) >= low - 0.03).all() and (points.max(0) <= high + 0.03).all()
    cut = place_grid(RIG, hidden(unknown), 0.05, rule=CarveRule(least_agreeing=3))
    assert cut.origin_m[2] > points[:, 2].min() + 0.2
