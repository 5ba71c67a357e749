"""Lenses from boards: synthetic ones whose truth is known, and real ones."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from benchmarks.board_scene import CHECKERBOARD, lens_views
from calib.board import Board, BoardView
from calib.camera import Camera
from calib.errors import InputError
from calib.intrinsics import calibrate_intrinsics, lens_error_px

MATRIX = np.array([[900.0, 0, 650], [0, 905, 350], [0, 0, 1]])


def camera(distortion, fisheye=False, matrix=MATRIX) -> Camera:
    return Camera(
        "cam_1", (1280, 720), matrix, np.array(distortion), np.eye(3), np.zeros(3), fisheye
    )


@pytest.mark.parametrize(
    ("lens", "distortion"),
    [
        ("pinhole", [-0.2, 0.08, 0.001, -0.001]),
        ("rational", [-0.2, 0.08, 0.001, -0.001, 0.0, 0.02, 0.0, 0.0]),
        ("fisheye", [0.05, -0.02, 0.01, -0.005]),
    ],
)
def test_the_true_lens_is_found_in_noise(lens, distortion):
    truth = camera(distortion, lens == "fisheye")
    result = calibrate_intrinsics(CHECKERBOARD, lens_views(truth, 20, noise_px=0.3), lens)
    np.testing.assert_allclose(np.diag(result.camera.matrix)[:2], [900, 905], rtol=0.005)
    np.testing.assert_allclose(result.camera.matrix[:2, 2], [650, 350], atol=5)
    assert result.rms_px == pytest.approx(0.3 * np.sqrt(2), rel=0.15)  # both coordinates
    assert all(line.left_out is None for line in result.pictures)
    # What counts is where rays go: compare over the part of the image that boards covered.
    grid = np.meshgrid(np.linspace(200, 1080, 20), np.linspace(100, 620, 20))
    pixels = np.stack(grid, -1).reshape(-1, 2)
    offset = result.camera.project(truth.rays(pixels)[1])[0] - pixels
    assert np.abs(offset - np.median(offset, axis=0)).max() < 2
    off_px = np.abs(np.diag(result.camera.matrix)[:2] - [900, 905])
    assert (off_px < 4 * result.focal_error_px).all()
    assert (result.focal_error_px < 5).all()


def test_what_markers_do_in_all_pictures_counts():
    plain = Board(8, 5, 0.03)
    views = lens_views(camera([0.0] * 4), 12, 0.1, plain)
    marked = replace(plain, marker_m=0.02)
    error_px, with_markers_px = (
        calibrate_intrinsics(board, views).focal_error_px for board in (plain, marked)
    )
    np.testing.assert_allclose(with_markers_px, np.hypot(error_px, [0.9, 0.905]), rtol=0.01)


def test_an_earlier_lens_is_judged_in_the_same_pictures():
    truth = camera([-0.2, 0.08, 0.001, -0.001])
    views = [*lens_views(truth, 12, noise_px=0.2).values()]
    assert lens_error_px(CHECKERBOARD, truth, views) == pytest.approx(0.2 * np.sqrt(2), rel=0.15)
    assert lens_error_px(CHECKERBOARD, camera([0.0, 0.0, 0.0, 0.0]), views) > 1


def test_pictures_that_are_all_as_coarse_are_all_kept():
    views = lens_views(camera([0.0] * 4), 8, noise_px=0.8)
    result = calibrate_intrinsics(CHECKERBOARD, views)
    assert result.rms_px > 0.8
    assert all(line.left_out is None for line in result.pictures)


def test_a_bad_picture_is_left_out_and_named():
    views = lens_views(camera([0.0] * 4), 10, noise_px=0.1)
    broken = views["picture_03"]
    pixels = broken.pixels + np.outer(np.arange(40) % 8 == 0, [5.0, 0])
    views["picture_03"] = BoardView(broken.ids, pixels, broken.size)
    result = calibrate_intrinsics(CHECKERBOARD, views | {"picture_10": "blurred"})
    lines = {line.picture: line for line in result.pictures}
    assert list(lines) == [*views, "picture_10"]
    assert "times the others' error" in (lines["picture_03"].left_out or "")
    assert lines["picture_10"].left_out == "blurred"
    assert sum(line.left_out is None for line in result.pictures) == 9
    np.testing.assert_allclose(np.diag(result.camera.matrix)[:2], [900, 905], rtol=0.005)


def test_too_few_or_odd_pictures_are_refused():
    views = lens_views(camera([0.0] * 4), 4, noise_px=0.1)
    few = dict(list(views.items())[:3]) | {"a": "blurred", "b": "blurred"}
    words = r"camera left: 3 of 5 pictures serve, 4 are needed \(blurred\)"
    with pytest.raises(InputError, match=words):
        calibrate_intrinsics(CHECKERBOARD, few, camera="left")
    odd = BoardView(views["picture_00"].ids, views["picture_00"].pixels, (640, 480))
    with pytest.raises(InputError, match="pictures of different sizes"):
        calibrate_intrinsics(CHECKERBOARD, views | {"odd": odd})
    with pytest.raises(InputError, match="0 of 0 pictures serve"):
        calibrate_intrinsics(CHECKERBOARD, {})


def test_boards_that_never_tilt_are_reported():
    truth = camera([0.0] * 4)
    rng = np.random.default_rng(0)
    views = {}
    for index in range(6):
        points = CHECKERBOARD.points_m + np.array([-0.3 + 0.02 * index, -0.1, 1.0])
        pixels = truth.project(points)[0] + rng.normal(0, 0.3, (len(points), 2))
        views[str(index)] = BoardView(np.arange(len(points)), pixels, truth.size)
    try:
        advice = calibrate_intrinsics(CHECKERBOARD, views).advice
    except InputError as error:
        advice = [str(error)]
    assert any("tilt the board" in line for line in advice)


@pytest.mark.accuracy
def test_real_boards(shared):
    board = Board(7, 4, 0.06)
    for number in (1, 4):
        folder = shared / "data" / "board_images" / f"cam_{number}"
        views = {
            path.name: board.find(cv2.imread(str(path))) for path in sorted(folder.glob("*.jpg"))
        }
        result = calibrate_intrinsics(board, views, camera=folder.name)
        assert result.rms_px < 0.5
        assert sum(line.left_out is None for line in result.pictures) >= 6
        # The Qualisys file says 1674 to 1682, and -0.046 to -0.048.
        np.testing.assert_allclose(np.diag(result.camera.matrix)[:2], 1675, atol=10)
        assert result.camera.distortion[0] == pytest.approx(-0.047, abs=0.01)
