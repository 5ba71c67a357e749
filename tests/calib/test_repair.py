"""Hypotheses about a camera: its clock, its pose, its picture."""

from types import SimpleNamespace

import numpy as np
import pytest
from rigs import PINHOLE, some_rig

from calib.repair import best_offset, moved_camera, stretched_camera

CAMERA = some_rig(PINHOLE).cameras[0]
PERIOD_S = 0.1


def suspect_late_by(offset_s: float):
    """Stands for a camera whose error rises evenly on both sides of an offset."""
    track = SimpleNamespace(period_s=PERIOD_S, time_s=np.arange(100) * PERIOD_S)
    return SimpleNamespace(
        track=track,
        max_offset_s=0.4,
        error=lambda camera, offset: 0.3 + 20 * abs(offset - offset_s),
    )


@pytest.mark.parametrize("offset_s", [0.043, 0.056, -0.031, 0.05])
def test_an_offset_between_the_steps_is_found(offset_s):
    found = best_offset(suspect_late_by(offset_s), CAMERA)  # type: ignore[arg-type]
    assert found == pytest.approx(offset_s, abs=1e-6)


def test_an_offset_beyond_the_largest_is_not_extrapolated():
    assert best_offset(suspect_late_by(0.7), CAMERA) == pytest.approx(0.4)  # type: ignore[arg-type]


def test_a_turned_camera_stays_in_its_place():
    turned = moved_camera(CAMERA, np.array([10.0, -5.0, 3.0]))
    np.testing.assert_allclose(turned.center_m, CAMERA.center_m, atol=1e-12)
    assert np.abs(turned.rotation - CAMERA.rotation).max() > 5e-3


def test_a_unit_of_every_parameter_moves_a_body_by_about_a_pixel():
    body = CAMERA.center_m + 4 * CAMERA.rotation[2] + 0.3 * CAMERA.rotation[1]
    before, _ = CAMERA.project(body[None])
    for one in (*np.eye(6)[:2], *np.eye(6)[3:5]):
        after, _ = moved_camera(CAMERA, one).project(body[None])
        assert np.linalg.norm(after - before) == pytest.approx(1, abs=0.1)


def test_a_stretched_picture_keeps_its_middle():
    middle = (np.array(CAMERA.size) - 1) / 2
    ray = CAMERA.rays(middle[None])[1]
    stretched = stretched_camera(CAMERA, np.array([10.0, -20.0, 0.0, 0.0]))
    assert stretched.matrix[0, 0] > CAMERA.matrix[0, 0]
    assert stretched.matrix[1, 1] < CAMERA.matrix[1, 1]
    np.testing.assert_allclose(stretched.project(CAMERA.center_m + ray)[0][0], middle, atol=1e-9)
    shifted = stretched_camera(CAMERA, np.array([0.0, 0.0, 3.0, -2.0]))
    np.testing.assert_allclose(
        shifted.project(CAMERA.center_m + ray)[0][0], middle + np.array([3, -2]), atol=1e-9
    )
