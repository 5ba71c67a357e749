"""Projection, rays and undistortion against OpenCV, and what a camera refuses."""

import cv2
import numpy as np
import pytest

from calib.camera import Camera, Rig
from calib.errors import InputError

MATRIX = np.array([[800.0, 0, 320], [0, 790, 240], [0, 0, 1]])
ROTATION = cv2.Rodrigues(np.array([0.1, 0.2, 0.3]))[0]
TRANSLATION = np.array([0.1, 0.2, 3.0])
FULL = np.array(
    [-0.3, 0.12, 0.001, -0.002, 0.01, 0.02, 0.01, 0.005, 0.001, -0.001, 0.002, 0.0005, 0.01, -0.02]
)
FISHEYE = np.array([0.05, -0.02, 0.01, -0.005])


def camera(distortion=(), fisheye=False, name="cam_1", **changes) -> Camera:
    values = {"matrix": MATRIX, "rotation": ROTATION, "translation": TRANSLATION} | changes
    values = {"size": (640, 480), "distortion": np.asarray(distortion, dtype=float)} | values
    return Camera(name=name, fisheye=fisheye, **values)


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (500, 3))


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_project_is_opencvs(points, count):
    pixels, depth_m = camera(FULL[:count]).project(points)
    lens = MATRIX, FULL[:count] if count else None
    theirs = cv2.projectPoints(points, ROTATION, TRANSLATION, *lens)[0][:, 0]
    np.testing.assert_allclose(pixels, theirs, atol=1e-9)
    np.testing.assert_allclose(depth_m, (points @ ROTATION.T + TRANSLATION)[:, 2])


def test_fisheye_project_is_opencvs(points):
    pixels, _ = camera(FISHEYE, fisheye=True).project(points)
    pose = cv2.Rodrigues(ROTATION)[0], TRANSLATION
    theirs = cv2.fisheye.projectPoints(points[:, None], *pose, MATRIX, FISHEYE)[0][:, 0]
    np.testing.assert_allclose(pixels, theirs, atol=1e-9)


@pytest.mark.parametrize(
    ("distortion", "fisheye"), [(FULL, False), (FULL[:5], False), (FISHEYE, True)]
)
def test_undistort_is_opencvs(points, distortion, fisheye):
    one = camera(distortion, fisheye)
    pixels, _ = one.project(points)
    module = cv2.fisheye if fisheye else cv2
    theirs = module.undistortPoints(pixels[:, None], MATRIX, distortion, P=MATRIX)[:, 0]
    # OpenCV stops after a few iterations.
    np.testing.assert_allclose(one.undistort(pixels), theirs, atol=0.1)
    np.testing.assert_allclose(one.undistort(pixels), one.pinhole().project(points)[0], atol=1e-8)


def test_a_point_behind_is_not_seen():
    one = camera(rotation=np.eye(3), translation=np.zeros(3))
    pixels, depth_m = one.project(np.array([[0, 0, -1.0], [0.1, 0, 0], [0, 0, 2.0]]))
    assert np.isnan(pixels[:2]).all()
    np.testing.assert_allclose(pixels[2], [320, 240])
    np.testing.assert_allclose(depth_m, [-1, 0, 2])


@pytest.mark.parametrize(
    ("distortion", "fisheye"), [([-0.3, 0, 0, 0], False), ([0.0, 0, 0, -2.0], True)]
)
def test_a_point_beyond_the_fold_is_not_seen(distortion, fisheye):
    one = camera(distortion, fisheye, rotation=np.eye(3), translation=np.zeros(3))
    limit = one.lens.field_radius
    assert 0.5 < limit < 2
    radii = np.linspace(0, 3, 400)
    pixels, _ = one.project(np.column_stack([radii, 0 * radii, 1 + 0 * radii]))
    np.testing.assert_array_equal(np.isnan(pixels[:, 0]), radii > limit)
    assert (np.diff(pixels[radii < limit, 0]) > 0).all()
    # A pixel that is farther out than the fold's image has no ray.
    edge = pixels[radii < limit, 0].max()
    _, directions = one.rays(np.array([[edge - 2, 240], [edge + 2, 240]]))
    assert np.isnan(directions).any(axis=1).tolist() == [False, True]


def test_fold_away_from_the_axis_is_found_with_strong_tangential_terms():
    one = camera([0, 0, 0.2, 0.0], rotation=np.eye(3), translation=np.zeros(3))
    # d y'' / d y = 1 + 6 p1 y vanishes at y = -1 / 1.2.
    assert one.lens.field_radius == pytest.approx(1 / 1.2, rel=0.05)
    pixels, _ = one.project(np.array([[0, -1.0, 1], [0, -0.7, 1]]))
    assert np.isnan(pixels).any(axis=1).tolist() == [True, False]


def test_fisheye_reaches_almost_to_the_side():
    one = camera([0.0] * 4, fisheye=True, rotation=np.eye(3), translation=np.zeros(3))
    angles = np.radians([10, 45, 80, 89])
    points = np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])
    pixels, _ = one.project(points)
    np.testing.assert_allclose(pixels[:, 0], 320 + 800 * angles)
    np.testing.assert_allclose(one.rays(pixels)[1], points, atol=1e-9)


def test_rays_start_at_the_centre_and_meet_the_points(points):
    one = camera(FULL)
    origin, directions = one.rays(one.project(points)[0])
    np.testing.assert_allclose(origin, one.center_m)
    np.testing.assert_allclose(one.rotation @ origin + one.translation, 0, atol=1e-12)
    expected = (points - origin) / np.linalg.norm(points - origin, axis=1, keepdims=True)
    np.testing.assert_allclose(directions, expected, atol=1e-10)


def test_skew_is_respected(points):
    skewed = camera(matrix=np.array([[800.0, 30, 320], [0, 790, 240], [0, 0, 1]]))
    pixels, depth_m = skewed.project(points)
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ skewed.projection.T
    np.testing.assert_allclose(pixels, homogeneous[:, :2] / homogeneous[:, 2:])
    np.testing.assert_allclose(homogeneous[:, 2], depth_m)
    plain = camera().rays(camera().project(points)[0])[1]
    np.testing.assert_allclose(skewed.rays(pixels)[1], plain)


def test_pinhole_scales_about_the_corner_of_the_image(points):
    half = camera(FULL[:5]).pinhole(0.5)
    assert half.size == (320, 240)
    assert half.is_pinhole
    full, _ = camera().project(points)
    np.testing.assert_allclose(half.project(points)[0], (full + 0.5) * 0.5 - 0.5)


def test_pinhole_maps_are_opencvs():
    map_x, map_y = camera(FULL[:5]).pinhole_maps()
    how = np.eye(3), MATRIX, (640, 480), cv2.CV_32FC1
    theirs = cv2.initUndistortRectifyMap(MATRIX, FULL[:5], *how)
    assert map_x.dtype == map_y.dtype == np.float32
    np.testing.assert_allclose(map_x, theirs[0], atol=1e-3)
    np.testing.assert_allclose(map_y, theirs[1], atol=1e-3)


def test_pinhole_maps_show_nothing_beyond_the_fold():
    wide = camera([-0.3, 0, 0, 0], matrix=np.array([[200.0, 0, 320], [0, 200, 240], [0, 0, 1]]))
    map_x, map_y = wide.pinhole_maps(0.5)
    assert map_x.shape == map_y.shape == (240, 320)
    assert map_x[0, 0] == map_y[0, 0] == -1
    assert map_x[120, 160] == pytest.approx(320.5, abs=0.01)  # the centre of that half-size pixel
    white = cv2.remap(np.full((480, 640), 255, np.uint8), map_x, map_y, cv2.INTER_LINEAR)
    assert white[0, 0] == 0
    assert white[120, 160] == 255


def test_arrays_are_frozen_copies():
    matrix = MATRIX.copy()
    one = camera(matrix=matrix)
    matrix[0, 0] = 1
    assert one.matrix[0, 0] == 800
    with pytest.raises(ValueError, match="read-only"):
        one.matrix[0, 0] = 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size": (0, 480)}, "size must be"),
        ({"matrix": np.eye(4)}, r"matrix must be \(3, 3\), got \(4, 4\)"),
        ({"matrix": np.diag([0.0, 1, 1])}, "focal lengths must be positive"),
        ({"matrix": np.diag([1.0, 1, 2])}, "matrix must be"),
        ({"matrix": np.full((3, 3), np.nan)}, r"matrix must be \(3, 3\) finite"),
        (
            {"distortion": [0.1] * 3},
            "distortion must have 0 or 4 or 5 or 8 or 12 or 14 numbers, got 3",
        ),
        ({"distortion": [0.1] * 5, "fisheye": True}, "distortion must have 4 numbers"),
        ({"rotation": np.diag([1.0, 1, -1])}, "rotation must be a rotation"),
        ({"rotation": 2 * np.eye(3)}, "rotation must be a rotation"),
        ({"translation": [0.0, 1.0]}, r"translation must be \(3,\)"),
    ],
)
def test_impossible_values_are_refused(changes, message):
    with pytest.raises(ValueError, match=f"camera cam_1: {message}"):
        camera(**changes)


def test_arguments_of_the_wrong_shape_are_refused():
    with pytest.raises(ValueError, match=r"points_world must be \(N, 3\), got \(3,\)"):
        camera().project(np.zeros(3))
    with pytest.raises(ValueError, match=r"pixels must be \(N, 2\), got \(1, 3\)"):
        camera().rays(np.zeros((1, 3)))
    with pytest.raises(ValueError, match="scale must be positive"):
        camera().pinhole(0)


def test_nothing_in_nothing_out():
    for one in (camera(FULL), camera(FISHEYE, fisheye=True), camera()):
        assert one.project(np.zeros((0, 3)))[0].shape == (0, 2)
        assert one.rays(np.zeros((0, 2)))[1].shape == (0, 3)


def test_rig_finds_and_selects_by_name():
    rig = Rig((camera(name="a"), camera(name="b"), camera(name="c")))
    assert rig.names == ("a", "b", "c") == tuple(one.name for one in rig) and len(rig) == 3
    assert rig["b"].name == "b" and "c" in rig
    assert rig.select(["c", "a"]).names == ("c", "a")
    with pytest.raises(InputError, match="no calibration for d: the rig has a, b, c"):
        rig.select(["a", "d"])
    with pytest.raises(InputError, match="no camera is chosen: the rig has a, b, c"):
        rig.select([])
    with pytest.raises(KeyError, match="no camera 'd' among a, b, c"):
        rig["d"]
    with pytest.raises(ValueError, match="more than once: a"):
        Rig((camera(name="a"), camera(name="a")))
    with pytest.raises(ValueError, match="at least one camera"):
        Rig(())
