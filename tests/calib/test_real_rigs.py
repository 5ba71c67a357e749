"""The readers and the projection on real calibrations."""

import cv2
import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from calib.files import read_rig


def test_standing4_board_projects_onto_its_corners(shared):
    folder = shared / "data" / "standing4"
    board = np.stack(np.meshgrid(np.arange(8), np.arange(6), [0]), -1).reshape(-1, 3) * 0.115
    for camera in read_rig(folder / "calibration.toml"):
        corners = np.load(folder / f"{camera.name}_board_corners_8x6.npy", allow_pickle=False)
        corners, (pixels, _) = corners.reshape(-1, 2), camera.project(board)
        # A board looks the same from both ends: one camera lists its corners from the other one.
        either = (np.linalg.norm(pixels - listed, axis=1) for listed in (corners, corners[::-1]))
        assert min(error.mean() for error in either) < 1.2


def test_dancer8_points_lie_in_its_silhouettes(shared):
    folder = shared / "data" / "dancer8"
    silhouettes = [
        cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 0
        for path in sorted(folder.glob("silh_*.pbm"))
    ]
    with pytest.raises(InputError, match="camera cam_0: the image size is not in the file"):
        read_rig(folder / "projections.json")
    rig = read_rig(folder / "projections.json", size=silhouettes[0].shape[::-1])
    points = np.asarray(trimesh.load(folder / "surfacePtCloud.ply").vertices)
    for camera, silhouette in zip(rig, silhouettes, strict=True):
        pixels, depth_m = camera.project(points)
        assert (depth_m > 2).all()
        # Its author carved in a language that counts pixels from 1.
        column, row = np.rint(pixels).astype(int).T - 1
        assert silhouette[row, column].all()
        assert abs(camera.matrix[0, 1]) < 1


def test_board_images_qualisys_file_is_balancing4s_rig(shared):
    rig = read_rig(shared / "data" / "board_images" / "Calib.qca.txt")
    known = read_rig(shared / "data" / "balancing4" / "calibration.toml")
    for ours, theirs in zip(rig, known, strict=True):
        assert ours.size == (1088, 1920)
        np.testing.assert_allclose(ours.center_m, theirs.center_m, atol=1e-12)
        np.testing.assert_allclose(ours.rotation, theirs.rotation, atol=1e-12)
        # That recording's file has gone through a program that divides distortion by 64.
        np.testing.assert_allclose(ours.distortion[:4], 64 * theirs.distortion, atol=1e-12)
    for name in ("cam03", "cam04"):  # the videos of the other two are letterboxed
        matrix = known[name.replace("cam0", "cam_")].matrix
        np.testing.assert_allclose(rig[name].matrix, matrix, atol=1e-6)
