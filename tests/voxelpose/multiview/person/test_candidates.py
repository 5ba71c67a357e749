"""Heights of hulls, and the statures from which searches begin."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.person.posterior import (
    StatureEvidence,
    hull_distance_sigma,
    hull_height_m,
)

VIEWS = SimpleNamespace(center_m=np.array([[-4.0, 0.0, 1.0], [-4.0, 1.0, 1.0]]))


def frame(height_m: float):
    """A frame whose hull is so high."""
    occupancy = np.zeros((4, 5, 60), bool)
    occupancy[1, 2, 3] = occupancy[3, 0, 2 + round(height_m / 0.05)] = True
    return of_hull(occupancy)


def of_hull(occupancy: np.ndarray):
    """A frame with a hull, seen by two cameras that look along x."""
    grid = VoxelGrid(np.zeros(3), 0.05, occupancy.shape)
    return SimpleNamespace(occupancy=occupancy, grid=grid, views=VIEWS)


def test_a_hull_is_as_high_as_its_lowest_and_highest_voxels():
    assert hull_height_m(frame(1.4)) == pytest.approx(1.4)  # type: ignore[arg-type]


def test_the_ends_of_the_cones_beside_a_hull_s_middle_are_no_height():
    occupancy = np.zeros((60, 20, 60), bool)
    for x in range(60):  # it rises away from the cameras
        occupancy[x, 8:12, 10 : 30 + x // 2] = True
    assert hull_height_m(of_hull(occupancy)) == pytest.approx(1.95, abs=0.06)  # type: ignore[arg-type]


def test_a_long_hull_leaves_the_distance_unknown():
    long, short = np.zeros((60, 8, 40), bool), np.zeros((60, 8, 40), bool)
    long[:], short[:8] = True, True
    # 3 m long, evenly filled, 5.5 m away: less a torso's own radius.
    sigma = np.sqrt(3.0**2 / 12 - 0.2**2) / 5.5
    assert hull_distance_sigma(of_hull(long)) == pytest.approx(sigma, rel=0.03)  # type: ignore[arg-type]
    assert hull_distance_sigma(of_hull(short)) == 0.0  # type: ignore[arg-type]


def test_what_the_distance_leaves_open_people_s_statures_decide():
    sure, unsure, lost = (StatureEvidence(None, (2.2,), sigma) for sigma in (0.0, 0.1, 10.0))
    assert sure.prior(2.2).metres == 2.2 and sure.prior(2.2).sigma_m == pytest.approx(0.11)
    assert 1.8 < unsure.prior(2.2).metres < 2.1
    assert lost.prior(2.2).metres == pytest.approx(1.7, abs=0.01)
    assert lost.prior(2.2).sigma_m == pytest.approx(np.hypot(0.12, 0.11), rel=0.01)


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
