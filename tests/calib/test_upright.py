"""Which way is up, told from how cameras stand; and the frame in which z is up."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from calib.errors import InputError
from calib.rotation import matrix_from_rodrigues
from calib.upright import (
    AXES,
    Z_UP,
    UprightFrame,
    axis_name,
    cameras_worth,
    direction_of,
    other_up,
    up_candidates,
    up_from_cameras,
)
from tests.sources import ring

RING = ring(4)
ROLL = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a camera on its side


def turned(rig, rotation):
    """The same cameras in a world of other axes: new = rotation @ old."""
    return Rig(tuple(replace(c, rotation=c.rotation @ rotation.T) for c in rig))


def rolled(rig, quarters):
    """The same places with cameras turned about their own axes by so many quarter turns each."""
    cameras = []
    for camera, count in zip(rig, quarters, strict=True):
        roll = np.linalg.matrix_power(ROLL, count)
        cameras.append(
            replace(camera, rotation=roll @ camera.rotation, translation=roll @ camera.translation)
        )
    return Rig(tuple(cameras))


def leaning(rig, degrees, seed=0):
    """Cameras that hang by a few degrees at random."""
    rng = np.random.default_rng(seed)
    return Rig(
        tuple(
            replace(
                camera, rotation=matrix_from_rodrigues([0, 0, np.radians(lean)]) @ camera.rotation
            )
            for camera, lean in zip(rig, rng.uniform(-degrees, degrees, len(rig)), strict=True)
        )
    )


@pytest.mark.parametrize("name", AXES)
def test_level_cameras_name_the_axis_that_is_up(name):
    rig = turned(leaning(RING, 12), UprightFrame.from_up(AXES[name]).rotation.T)
    np.testing.assert_array_equal(up_candidates(rig)[0], AXES[name])
    said = other_up(rig)
    assert said is None if name == "z" else axis_name(said) == name


def test_in_the_first_cameras_world_no_axis_is_taken_for_up():
    own = RING.cameras[0].rotation
    found = up_from_cameras(turned(RING, own))
    np.testing.assert_allclose(found, own @ Z_UP, atol=5e-3)
    assert all(np.abs(found @ axis) < 0.9999 for axis in AXES.values())


@pytest.mark.parametrize("quarters", [(1, 0, 0, 0), (0, 0, 3, 1), (2, 0, 0, 0)])
@pytest.mark.parametrize("name", ["z", "-z", "y"])
def test_some_cameras_on_their_side_mislead_nobody(quarters, name):
    rig = turned(rolled(RING, quarters), UprightFrame.from_up(AXES[name]).rotation.T)
    np.testing.assert_array_equal(up_candidates(rig)[0], AXES[name])


@pytest.mark.parametrize("count", [1, 3])
def test_where_all_cameras_lie_on_their_side_z_stays_up(count):
    np.testing.assert_array_equal(up_from_cameras(rolled(RING, (count,) * 4)), Z_UP)


def test_a_camera_under_the_ceiling_tells_nothing():
    tilt = np.radians(5.0)
    down = np.array(
        [[1, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]]
    )
    ceiling = replace(RING.cameras[0], rotation=np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1.0]]))
    level = replace(RING.cameras[0], rotation=down)
    np.testing.assert_array_equal(up_from_cameras(Rig((ceiling,))), Z_UP)
    np.testing.assert_array_equal(up_from_cameras(Rig((level,))), Z_UP)


def test_a_camera_worth_less_the_more_it_leans():
    level, leant = (cameras_worth(leaning(RING, by), Z_UP) for by in (0.0, 30.0))
    assert level == pytest.approx(1.0)
    assert 0.5 < leant < 0.95
    assert cameras_worth(turned(RING, np.diag([1.0, -1.0, -1.0])), Z_UP) == pytest.approx(0.3)


def test_two_cameras_side_by_side_take_their_pictures_vertical():
    pair = Rig((RING.cameras[0], replace(RING.cameras[0], name="cam_9")))
    np.testing.assert_array_equal(up_candidates(pair)[0], Z_UP)


@pytest.mark.parametrize("up", [*AXES.values(), np.array([0.3, -0.5, -0.6])])
def test_the_upright_frame_has_its_floor_at_zero_and_the_pictures_stay(up):
    frame = UprightFrame.from_up(up, 0.4)
    up = up / np.linalg.norm(up)
    np.testing.assert_allclose(frame.rotation @ frame.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(frame.rotation @ up, Z_UP, atol=1e-12)
    np.testing.assert_allclose(frame.points(0.4 * up), np.zeros(3), atol=1e-12)
    points = np.random.default_rng(0).normal(size=(5, 3))
    np.testing.assert_allclose(frame.world_points(frame.points(points)), points, atol=1e-12)
    for camera, moved in zip(RING, frame.rig(RING), strict=True):
        seen, _ = camera.project(points)
        np.testing.assert_allclose(moved.project(frame.points(points))[0], seen, atol=1e-8)


def test_a_world_with_z_up_stays_what_it_is():
    frame = UprightFrame.from_up(Z_UP)
    assert frame.is_world
    assert frame.rig(RING) is RING


@pytest.mark.parametrize(
    ("text", "direction"),
    [("-z", (0, 0, -1)), ("+Y", (0, 1, 0)), ("0, 3, 4", (0, 0.6, 0.8)), ("x", (1, 0, 0))],
)
def test_directions_are_read(text, direction):
    np.testing.assert_allclose(direction_of(text), direction, atol=1e-12)


@pytest.mark.parametrize("text", ["up", "", "1,2", "0,0,0", "nan,0,1", "1,2,3,4"])
def test_what_is_no_direction_is_refused(text):
    with pytest.raises(InputError, match="is no direction"):
        direction_of(text)
