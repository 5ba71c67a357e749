"""Heights of hulls, and which statures are alike."""

from types import SimpleNamespace

import numpy as np
import pytest

from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.person.stature_search import _alike, _height_m


def test_a_hull_is_as_high_as_its_lowest_and_highest_voxels():
    occupancy = np.zeros((4, 5, 40), bool)
    occupancy[1, 2, 3] = occupancy[3, 0, 30] = True
    frame = SimpleNamespace(occupancy=occupancy, grid=VoxelGrid(np.zeros(3), 0.05, (4, 5, 40)))
    assert _height_m(frame) == pytest.approx(28 * 0.05)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "alike"), [(1.55, True), (1.45, False), (1.9, True), (2.0, False)]
)
def test_statures_within_a_seventh_are_alike(other, alike):
    assert _alike(1.7, other) == _alike(other, 1.7) == alike
