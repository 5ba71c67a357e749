"""Heights of hulls, and the statures from which searches begin."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.person.posterior import StatureEvidence, hull_height_m


def frame(height_m: float):
    """A frame whose hull is so high."""
    occupancy = np.zeros((4, 5, 60), bool)
    occupancy[1, 2, 3] = occupancy[3, 0, 2 + round(height_m / 0.05)] = True
    return SimpleNamespace(occupancy=occupancy, grid=VoxelGrid(np.zeros(3), 0.05, (4, 5, 60)))


def test_a_hull_is_as_high_as_its_lowest_and_highest_voxels():
    assert hull_height_m(frame(1.4)) == pytest.approx(1.4)  # type: ignore[arg-type]


def test_the_ends_of_the_cones_beside_a_hull_s_middle_are_no_height():
    occupancy = np.zeros((60, 20, 60), bool)
    for x in range(60):  # it rises away from the cameras
        occupancy[x, 8:12, 10 : 30 + x // 2] = True
    one = SimpleNamespace(occupancy=occupancy, grid=VoxelGrid(np.zeros(3), 0.05, (60, 20, 60)))
    assert hull_height_m(one) == pytest.approx(1.95, abs=0.06)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("heights_m", "first"),
    [((1.6, 1.65, 1.7), (1.65,)), ((1.2, 1.2, 1.7), (1.2, 1.7)), ((1.8, 1.8, 1.2), (1.8,))],
)
def test_the_usual_height_is_searched_and_the_largest_where_it_varies(heights_m, first):
    frames = {t: frame(height) for t, height in enumerate(heights_m)}
    evidence = StatureEvidence.from_frames(frames, Settings())  # type: ignore[arg-type]
    found, adult = evidence.statures_m("any")
    assert found == pytest.approx(first) and adult == pytest.approx((1.7,))
    assert evidence.statures_m("sitting") == ((1.7,),)


def test_a_stature_that_was_told_is_the_only_one():
    evidence = StatureEvidence(1.62, (1.2, 1.9))
    assert evidence.statures_m("any") == evidence.statures_m("sitting") == ((1.62,),)
