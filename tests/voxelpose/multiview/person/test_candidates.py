"""Heights of hulls, and the statures from which searches begin."""

from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.person.posterior import StatureEvidence, distance_sigma, hull_height_m


def frame(height_m: float):
    """A frame whose hull is so high."""
    occupancy = np.zeros((4, 5, 60), bool)
    occupancy[1, 2, 3] = occupancy[3, 0, 2 + round(height_m / 0.05)] = True
    return of_hull(occupancy)


def of_hull(occupancy: np.ndarray, *azimuths_deg: float):
    """A frame with a hull about the origin, seen from these sides by cameras 4 m away."""
    size_m = 0.05 * np.array(occupancy.shape)
    grid = VoxelGrid(np.array([0, 0, 1]) - size_m / 2, 0.05, occupancy.shape)
    at = np.radians(azimuths_deg or (0, 90))
    views = SimpleNamespace(center_m=4 * np.column_stack([np.cos(at), np.sin(at), 0.25 + 0 * at]))
    masks = [np.ones((2, 2), bool) for _ in at]
    return SimpleNamespace(occupancy=occupancy, grid=grid, views=views, masks=masks)


def test_a_hull_is_as_high_as_its_lowest_and_highest_voxels():
    assert hull_height_m(frame(1.4)) == pytest.approx(1.4)  # type: ignore[arg-type]


def test_the_ends_of_the_cones_beside_a_hull_s_middle_are_no_height():
    occupancy = np.zeros((60, 20, 60), bool)
    for x in range(60):  # it rises away from the cameras
        occupancy[x, 8:12, 10 : 30 + x // 2] = True
    assert hull_height_m(of_hull(occupancy)) == pytest.approx(1.95, abs=0.06)  # type: ignore[arg-type]


def test_cameras_that_look_the_same_way_leave_the_distance_unknown():
    solid = np.ones((8, 8, 40), bool)
    # The hull of a disc of radius r, seen from nearly one direction by two cameras an angle apart,
    # is a rhombus with a half diagonal of r / sin(angle / 2) along it: a triangular distribution.
    for apart_deg in (20, 30):
        half_m = 0.2 / np.sin(np.radians(apart_deg / 2))
        sigma = np.sqrt(half_m**2 / 6 - 0.1**2) / 4
        found = distance_sigma(of_hull(solid, 0, apart_deg))
        assert found == pytest.approx(sigma, rel=0.15)
    assert distance_sigma(of_hull(solid, 0, 90)) < 0.02
    assert distance_sigma(of_hull(solid, 0, 90, 180, 270)) < 0.02


def test_a_hull_that_wrong_silhouettes_lengthen_leaves_no_distance_unknown():
    wide = np.ones((50, 40, 40), bool)
    assert distance_sigma(of_hull(wide, 0, 90, 180, 270)) < 0.02


def test_cameras_that_do_not_see_the_person_do_not_tell_the_distance():
    frame = of_hull(np.ones((8, 8, 40), bool), 0, 30, 120)
    assert distance_sigma(frame) < 0.05
    frame.masks[2][:] = False
    assert distance_sigma(frame) == distance_sigma(of_hull(frame.occupancy, 0, 30))


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
