"""Where cameras stand, from points of the scene."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.board_scene import room, without_poses
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.points import ScenePoints, calibrate_from_points, measured_errors


def listed(rig: Rig, measured: int, noise_px: float = 0.3, scene=None) -> ScenePoints:
    """Lists points of a room, usually 24, as the cameras see them; the first few are measured."""
    rng = np.random.default_rng(0)
    if scene is None:
        scene = rng.uniform([-1.5, -1.5, 0], [1.5, 1.5, 2], (24, 3))
    pixels = {f"p{index}": {} for index in range(len(scene))}
    for camera in rig:
        for index, pixel in enumerate(camera.project(scene)[0]):
            pixels[f"p{index}"][camera.name] = pixel + rng.normal(0, noise_px, 2)
    return ScenePoints(pixels, {f"p{index}": scene[index] for index in range(measured)})


def test_cameras_stand_in_the_world_of_the_measured_points():
    truth = room(4)
    result = calibrate_from_points(without_poses(truth), listed(truth, measured=8))
    assert result.advice == ()
    for camera, line in zip(truth, result.table, strict=True):
        millimetres, degrees = pose_difference(result.rig[camera.name], camera)
        assert millimetres < min(25, 4 * line.position_mm)
        assert degrees < min(0.3, 4 * line.rotation_deg)
        assert line.seen == 24
    assert result.shared_boards["cam_0", "cam_1"] == 24


def test_an_earlier_calibration_is_judged_by_the_measured_points():
    truth = room(2)
    points = listed(truth, measured=20)
    errors = measured_errors(truth, points)
    assert errors == pytest.approx(dict.fromkeys(truth.names, 0.3 * np.sqrt(2)), rel=0.4)
    first, second = truth
    moved = Rig((replace(first, translation=first.translation + np.array([0.1, 0, 0])), second))
    assert measured_errors(moved, points)[first.name] > 5
    assert measured_errors(moved, points)[second.name] == errors[second.name]
    assert measured_errors(without_poses(room(3)), listed(truth, measured=0)) == {}


def test_a_camera_without_measured_points_is_reached_by_shared_ones():
    truth = room(3)
    points = listed(truth, measured=8, noise_px=0.1)
    for name in points.known_m:
        del points.pixels[name]["cam_2"]
    result = calibrate_from_points(without_poses(truth), points)
    assert pose_difference(result.rig["cam_2"], truth["cam_2"])[0] < 25
    for name in points.pixels.keys() - points.known_m.keys():
        points.pixels[name] = {"cam_2": points.pixels[name]["cam_2"]}
    words = r"too few points to place cam_2 \(.*: cam_2 0; 4 are needed\)"
    with pytest.raises(InputError, match=words):
        calibrate_from_points(without_poses(truth), points)


def test_a_point_that_was_confused_is_named():
    truth = room(3)
    points = listed(truth, measured=10)
    points.pixels["p3"]["cam_1"] += 25
    result = calibrate_from_points(without_poses(truth), points)
    assert result.advice[0].startswith("point p3 in camera cam_1 is off by ")
    assert pose_difference(result.rig["cam_1"], truth["cam_1"])[0] < 40
    points.pixels["lonely"] = {"cam_0": np.array([600.0, 300.0])}
    assert "of no use: lonely" in calibrate_from_points(without_poses(truth), points).advice[-1]


def test_what_cannot_work_is_refused():
    truth = room(2)
    with pytest.raises(InputError, match="3 points have world coordinates, 4 are needed"):
        calibrate_from_points(without_poses(truth), listed(truth, measured=3))
    with pytest.raises(InputError, match="points are listed for camera cam_1, which has no lens"):
        calibrate_from_points(without_poses(truth.select(["cam_0"])), listed(truth, measured=8))


@pytest.mark.parametrize(
    "scene",
    [np.tile([[0.2, 0.1, 1.0]], (12, 1)), np.linspace([-1.0, 0.0, 1.0], [1.0, 0.5, 1.2], 12)],
    ids=["one point", "a line"],
)
def test_points_that_do_not_place_a_camera_are_refused(scene):
    truth = room(3)
    with pytest.raises(InputError, match="its points do not say where it stands"):
        calibrate_from_points(without_poses(truth), listed(truth, len(scene), 0.0, scene))
