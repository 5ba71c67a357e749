"""Pixels that voxels cover."""

import numpy as np
import pytest
from carving_scenes import look_at

from voxelpose.multiview.carving.footprint import footprint
from voxelpose.multiview.carving.grid import VoxelGrid


@pytest.mark.parametrize("seed", range(20))
def test_a_footprint_holds_every_point_of_its_voxels_and_little_more(seed):
    rng = np.random.default_rng(seed)
    grid = VoxelGrid(rng.normal(size=3), float(rng.uniform(0.01, 0.06)), (5, 6, 7))
    middle, away = grid.origin_m + 0.5 * grid.size_m, rng.normal(size=3)
    away /= np.linalg.norm(away)
    camera = look_at("c", middle + rng.uniform(0.7, 4) * away, middle + 0.2 * rng.normal(size=3))
    occupancy = rng.random(grid.shape) < 0.02
    occupancy[tuple(rng.integers(0, 5, 3))] = True
    covered = footprint(occupancy, grid, camera)
    mask = np.zeros((120, 160), bool)
    mask[rng.integers(0, 120) :, rng.integers(0, 160) :] = rng.random() < 0.9
    np.testing.assert_array_equal(footprint(occupancy, grid, camera, mask), mask & covered)
    centres = grid.occupied_points(occupancy)
    inside = grid.voxel_size_m * rng.uniform(-0.5, 0.5, (400, 3))
    pixels, _ = camera.project((centres[:, None] + inside).reshape(-1, 3))
    middles, depths_m = camera.project(centres)
    shown = np.isfinite(middles).all(axis=1) & ((middles > -0.4) & (middles < (159, 119))).all(
        axis=1
    )
    own = np.rint(pixels.reshape(-1, 400, 2)[shown]).reshape(-1, 2)
    own = own[((own >= 0) & (own < (160, 120))).all(axis=1)].astype(int)
    assert covered[own[:, 1], own[:, 0]].all()
    size_px = 150 * grid.voxel_size_m / max(depths_m.min(), 0.1)
    rows, columns = np.nonzero(covered)
    apart = np.abs(np.stack([columns, rows], axis=1)[:, None] - middles[shown]).max(axis=2)
    assert not len(apart) or apart.min(axis=1).max() <= size_px + 2
