"""Where cameras stand, from boards: synthetic rooms whose truth is known, and a real one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from boards import CHECKERBOARD, FACE_UP, board_views, room, seen, without_poses

from benchmarks.board_scene import align_rigs
from calib.board import Board, BoardView
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import board_errors, calibrate_extrinsics, camera_error, pose_difference
from calib.files import read_rig


def on_the_floor(rig: Rig, board: Board, noise_px: float = 0.0) -> dict[str, BoardView]:
    """Lays a board on the floor, face up: its z points down."""
    views = {}
    for camera in rig:
        view = seen(camera, board, (FACE_UP, np.zeros(3)), noise_px, np.random.default_rng(1))
        if view is not None:
            views[camera.name] = view
    return views


def test_a_room_is_found_in_noise():
    truth = room(4)
    result = calibrate_extrinsics(
        CHECKERBOARD, without_poses(truth), board_views(truth, CHECKERBOARD, 60, noise_px=0.3)
    )
    assert result.rms_px == pytest.approx(0.3 * np.sqrt(2), rel=0.1)
    aligned = align_rigs(result.rig, truth)
    for camera, line in zip(truth, result.table, strict=True):
        millimetres, degrees = pose_difference(aligned[camera.name], camera)
        assert millimetres < 5
        assert degrees < 0.1
        assert line.rms_px < 0.5
    # Standard errors are relative to the first camera: compare in its frame.
    base = truth.cameras[0]
    for camera, line in zip(truth.cameras[1:], result.table[1:], strict=True):
        rotation = camera.rotation @ base.rotation.T
        true = replace(
            camera, rotation=rotation, translation=camera.translation - rotation @ base.translation
        )
        millimetres, degrees = pose_difference(result.rig[camera.name], true)
        assert millimetres < 4 * line.position_mm
        assert degrees < 4 * line.rotation_deg
        assert 0.1 < line.position_mm < 5
    assert np.isnan(result.table[0].position_mm)
    assert result.advice == ()


def test_an_earlier_calibration_is_judged_by_the_same_boards():
    truth = room(3)
    views = board_views(truth, CHECKERBOARD, 12, noise_px=0.3)
    errors = board_errors(CHECKERBOARD, truth, views)
    assert errors == pytest.approx(dict.fromkeys(truth.names, 0.3 * np.sqrt(2)), rel=0.15)
    first, *others = truth
    moved = Rig((replace(first, translation=first.translation + np.array([0.1, 0, 0])), *others))
    after = board_errors(CHECKERBOARD, moved, views)
    assert max(after, key=lambda name: after[name]) == first.name
    assert after[first.name] > 3 * errors[first.name]
    far = Rig((replace(first, translation=first.translation + np.array([2.0, 0, 0])), *others))
    assert board_errors(CHECKERBOARD, far, views)[first.name] > 2 * after[first.name]
    two = Rig(tuple(others))
    assert board_errors(CHECKERBOARD, two, views).keys() == set(two.names)


def test_lenses_that_are_a_little_wrong_are_refined_with_the_poses():
    truth = room(3, arc_deg=90)
    larger = np.array([[1.02], [1.02], [1]])
    wrong = Rig(tuple(replace(one, matrix=one.matrix * larger) for one in without_poses(truth)))
    views = board_views(truth, CHECKERBOARD, 24, noise_px=0.1)
    result = calibrate_extrinsics(CHECKERBOARD, wrong, views, refine_lenses=True)
    stiff = calibrate_extrinsics(CHECKERBOARD, wrong, views)
    assert result.rms_px < 0.2 < stiff.rms_px
    for camera in truth:
        assert result.rig[camera.name].matrix[0, 0] == pytest.approx(camera.matrix[0, 0], rel=0.005)
    assert np.isnan(result.table[0].position_mm)
    assert 0.1 < result.table[1].position_mm < 30


def test_a_board_that_is_symmetric_can_be_used():
    board = Board(7, 5, 0.06)
    truth = room(4)
    views = board_views(truth, board, 60, noise_px=0.2)
    rng = np.random.default_rng(3)
    for moment in views.values():
        for name, view in moment.items():
            if rng.random() < 0.5:  # the detector started at the other end
                moment[name] = BoardView(view.ids, view.pixels[::-1], view.size)
    result = calibrate_extrinsics(board, without_poses(truth), views)
    assert result.rms_px < 0.4
    for camera in align_rigs(result.rig, truth):
        assert pose_difference(camera, truth[camera.name])[0] < 5


def test_the_floors_board_is_the_world():
    truth = room(4)
    board = CHECKERBOARD
    views = board_views(truth, board, 40, noise_px=0.1) | {"floor": on_the_floor(truth, board, 0.1)}
    assert len(views["floor"]) == 4
    result = calibrate_extrinsics(board, without_poses(truth), views, floor="floor")
    # The synthetic board's middle lies at the true origin, its first corner is the new one; rows
    # run along x, columns along -y.
    corner = np.array([-board.points_m[:, 0].mean(), board.points_m[:, 1].mean(), 0])
    for camera in truth:
        np.testing.assert_allclose(
            result.rig[camera.name].center_m, camera.center_m - corner, atol=0.01
        )
    with pytest.raises(InputError, match="the floor's board 'later' was not seen"):
        calibrate_extrinsics(board, without_poses(truth), views, floor="later")


def test_a_floor_board_that_hangs_over_the_cameras_is_refused():
    truth = room(3)
    ceiling = {
        camera.name: seen(
            camera, CHECKERBOARD, (np.eye(3), np.array([0, 0, 2.6])), 0.0, np.random.default_rng(0)
        )
        for camera in truth
    }
    views = board_views(truth, CHECKERBOARD, 30, 0.1) | {
        "ceiling": {name: view for name, view in ceiling.items() if view}
    }
    assert views["ceiling"]
    words = "would be under the floor: the board must lie on it, face up, at the moment 'ceiling'"
    with pytest.raises(InputError, match=words):
        calibrate_extrinsics(CHECKERBOARD, without_poses(truth), views, floor="ceiling")


def test_cameras_without_a_common_board_are_named_with_counts():
    truth = room(4)
    views = board_views(truth, CHECKERBOARD, 40, 0.1)
    split = {
        f"{moment}{side}": {name: view for name, view in result.items() if name in names}
        for moment, result in views.items()
        for side, names in (("a", {"cam_0", "cam_1"}), ("b", {"cam_2", "cam_3"}))
    }
    words = r"no board was seen by cam_0, cam_1 and cam_2, cam_3 together \(boards shared:"
    with pytest.raises(InputError, match=words + r" cam_0-cam_1 \d+, cam_0-cam_2 0"):
        calibrate_extrinsics(CHECKERBOARD, without_poses(truth), split)
    with pytest.raises(InputError, match="camera cam_3 saw boards but has no lens calibration"):
        few = truth.select(["cam_0", "cam_1", "cam_2"])
        calibrate_extrinsics(CHECKERBOARD, without_poses(few), views)
    half = Rig(tuple(replace(camera, size=(640, 360)) for camera in without_poses(truth)))
    words = "recorded at 1280x720, its lens was calibrated at 640x360"
    with pytest.raises(InputError, match=words):
        calibrate_extrinsics(CHECKERBOARD, half, views)


def test_a_camera_with_the_wrong_lens_is_named():
    truth = room(4)
    views = board_views(truth, CHECKERBOARD, 40, 0.1)
    first, second, third, last = without_poses(truth)
    third = replace(third, matrix=np.diag([1.25, 1, 1]) @ third.matrix)
    wrong = Rig((first, second, third, last))
    result = calibrate_extrinsics(CHECKERBOARD, wrong, views)
    assert [line for line in result.advice if "camera cam_2 disagrees with the others" in line]
    assert len(result.advice) == 1


def test_a_camera_with_mirrored_pictures_is_named_with_counts():
    truth = room(3)
    views = board_views(truth, CHECKERBOARD, 40, 0.2)
    for seen_now in views.values():
        if (view := seen_now.get("cam_1")) is not None:
            # As the detector counts a mirrored board of an even number of columns: rows from their
            # other end.
            grid = (view.pixels * [-1, 1] + [view.size[0] - 1, 0]).reshape(5, 8, 2)[:, ::-1]
            seen_now["cam_1"] = BoardView(view.ids, grid.reshape(-1, 2), view.size)
    words = r"camera cam_1's pictures are mirrored: of \d+ boards that cam_0 and cam_1 saw together"
    with pytest.raises(InputError, match=words):
        calibrate_extrinsics(CHECKERBOARD, without_poses(truth), views)
    pair = {
        moment: {name: view for name, view in result.items() if name != "cam_2"}
        for moment, result in views.items()
    }
    words = "the pictures of camera cam_0 or of camera cam_1 are mirrored"
    with pytest.raises(InputError, match=words):
        calibrate_extrinsics(CHECKERBOARD, without_poses(truth.select(["cam_0", "cam_1"])), pair)


def test_standing4s_corner_lists(shared):
    folder = shared / "data" / "standing4"
    known = read_rig(folder / "calibration.toml")
    board = Board(8, 6, 0.115)
    views = {}
    for camera in known:
        corners = np.load(folder / f"{camera.name}_board_corners_8x6.npy", allow_pickle=False)
        pixels = corners.reshape(-1, 2).astype(float)
        views[camera.name] = BoardView(np.arange(48), pixels, camera.size)
    result = calibrate_extrinsics(board, without_poses(known), {"board": views}, floor="board")

    square = []
    for camera in known:
        (again, _), pixels = camera.project(board.points_m), views[camera.name].pixels
        both = (((listed - again) ** 2).sum(axis=1).mean() for listed in (pixels, pixels[::-1]))
        square.append(min(both))
    # Theirs is the least squares, ours resists outliers.
    assert result.rms_px <= 1.01 * np.sqrt(np.mean(square))
    # Their world has z into the floor, ours out of it.
    for camera in known:
        np.testing.assert_allclose(
            result.rig[camera.name].center_m, camera.center_m * [1, -1, -1], atol=0.03
        )


def test_the_first_three_parameters_are_a_turn_and_the_others_a_shift():
    covariance = np.diag([1e-6, 1e-6, 1e-6, 4e-6, 4e-6, 4e-6])
    adjusted = SimpleNamespace(
        scene=SimpleNamespace(cameras=room(2).cameras),
        covariances=[covariance, covariance],
        residuals_px=np.ones((4, 2)),
    )
    line = camera_error(1, adjusted, SimpleNamespace(camera=np.array([0, 0, 1, 1])), 2)
    assert line.position_mm == pytest.approx(np.sqrt(12))
    assert line.rotation_deg == pytest.approx(np.degrees(np.sqrt(3e-6)))
