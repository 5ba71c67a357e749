import numpy as np
import pytest

from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from voxelpose.multiview.carving.grid import VoxelGrid


def test_indices_undo_centres():
    grid = VoxelGrid(np.array([-0.3, 0.1, 2.0]), 0.02, (7, 5, 3))
    indices = np.argwhere(np.ones(grid.shape))
    np.testing.assert_array_equal(voxels_at(grid, grid.centres(indices)), indices)


def test_two_grids_share_their_voxels_bit_for_bit():
    a = VoxelGrid(np.array([-1.0, -1.0, 0.0]), 0.017, (100, 90, 80))
    shift = np.array([13, 7, 5])
    b = VoxelGrid(a.origin_m + shift * 0.017, 0.017, (20, 20, 20))
    for mine, theirs, first in zip(a.axes(), b.axes(), shift, strict=True):
        np.testing.assert_array_equal(mine[first : first + 20], theirs)


def test_bounds_are_covered_and_not_widened_for_rounding():
    grid = VoxelGrid.from_bounds((-1.0, 0.003, 0.0), (1.0, 0.3, 0.021), 0.02)
    assert grid.shape == (100, 15, 2)
    np.testing.assert_allclose(grid.origin_m, [-1.0, 0.0, 0.0])


def test_cropping_keeps_every_occupied_voxel_where_it_is():
    grid = VoxelGrid(np.zeros(3), 0.1, (9, 8, 7))
    occupancy = np.zeros(grid.shape, bool)
    occupancy[3:5, 0, 6] = True
    cropped, inside = grid.cropped(occupancy)
    assert cropped.shape == inside.shape == (2, 1, 1)
    np.testing.assert_array_equal(cropped.occupied_points(inside), grid.occupied_points(occupancy))
    with pytest.raises(ValueError, match="no voxel is occupied"):
        grid.cropped(np.zeros(grid.shape, bool))


@pytest.mark.parametrize(
    ("origin", "size", "shape", "message"),
    [
        ((0, 0), 0.1, (1, 1, 1), "origin_m must be"),
        ((0, 0, np.nan), 0.1, (1, 1, 1), "origin_m must be"),
        ((0, 0, 0), 0.0, (1, 1, 1), "voxel_size_m must be positive"),
        ((0, 0, 0), 0.1, (1, 0, 1), "shape must be"),
        ((0, 0, 0), 0.1, (2000, 2000, 2000), "larger voxels"),
    ],
)
def test_impossible_grids_are_refused(origin, size, shape, message):
    with pytest.raises(ValueError, match=message):
        VoxelGrid(np.array(origin, float), size, shape)
