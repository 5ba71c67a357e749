"""Where a shadow on the floor is possible: near the person, or where other cameras see it dark."""

import numpy as np
import pytest

from tests.voxelpose.multiview.matching_scenes import (
    board_on_floor,
    fitting_model,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.silhouettes.floor_shadows import FloorShadows, floor_under

RIG = views(3).rig
SHADOWS = FloorShadows(RIG)


def on_floor(c: int, place_m: tuple[float, float]) -> tuple[int, int]:
    """Row and column of a place of the floor."""
    (pixel,), _ = RIG.cameras[c].project(np.array([[*place_m, 0.0]]))
    column, row = np.rint(pixel).astype(int)
    return row, column


def possible(dark_elsewhere: bool, person_m: tuple[float, float]) -> np.ndarray:
    """What may be a shadow in the first camera, all dark, where the others are, or are all lit."""
    dark = [np.full(camera.size[::-1], dark_elsewhere or not c) for c, camera in enumerate(RIG)]
    return SHADOWS.possible(dark, np.array(person_m))[0]


@pytest.mark.parametrize("person_m", [(0.5, 0.0), (40.0, 0.0)])
def test_a_place_that_another_camera_sees_is_as_dark_as_it_sees_it(person_m):
    assert possible(True, person_m)[on_floor(0, (0.0, 0.0))]
    assert not possible(False, person_m)[on_floor(0, (0.0, 0.0))]


def test_a_place_that_no_other_camera_sees_is_near_the_person():
    beyond = -1.9 * RIG.cameras[0].center_m[:2]
    row, column = on_floor(0, tuple(beyond))
    assert 0 <= row < RIG.cameras[0].size[1] and 0 <= column < RIG.cameras[0].size[0]
    others = [RIG.cameras[c].project(np.array([[*beyond, 0.0]]))[0][0] for c in (1, 2)]
    assert not any((pixel >= 0).all() and (pixel < 320).all() for pixel in others)
    assert possible(False, (beyond[0] + 1, beyond[1]))[row, column]
    assert not possible(True, (beyond[0], beyond[1] + 5))[row, column]


def test_there_is_no_shadow_above_the_horizon():
    camera = RIG.cameras[0]
    width, height = camera.size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    _, rays = camera.rays(np.column_stack([x.ravel(), y.ravel()]).astype(float))
    above = rays[:, 2].reshape(height, width) > 0
    assert above.any()
    for away in (1.0, 1.5, 3.0):
        behind = away * camera.center_m[:2]
        assert not possible(True, tuple(behind))[above].any()


def test_the_hull_of_a_board_on_the_floor_is_not_below_it():
    seen_by = views(4)
    room = VoxelGrid.from_bounds((-1.6, -1.6, -0.8), (1.6, 1.6, 2.1), 0.05)
    observer = HullObserver(seen_by, room, 0.04, CarveRule(least_agreeing=3))
    person = photograph(seen_by, fitting_model(), stance(fitting_model(), None, (-1.0, 0.0)))
    board = board_on_floor(seen_by, (-0.1, -0.4))
    frame = [a | b for a, b in zip(person, board, strict=True)]
    assert floor_under(observer, [person]) == floor_under(observer, [frame]) == 0.0
    assert floor_under(observer, [board]) < -0.15
