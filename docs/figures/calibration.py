"""Draws the pictures of docs/calibration.md: `python -m docs.figures.calibration` writes
docs/images/calibration_*.

A synthetic rig records a synthetic board; the rest is what the commands do.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.board_scene import (
    FACE_UP,
    BoardCamera,
    board_views,
    held_poses,
    room,
    without_poses,
)
from calib.board import Board
from calib.extrinsics import calibrate_extrinsics
from calib.intrinsics import calibrate_intrinsics
from voxelpose.calibration.lenses import Lens
from voxelpose.calibration.pictures import coverage_picture, png, rig_picture

IMAGES = Path(__file__).parents[1] / "images"
BOARD = Board(8, 5, 0.1)
SIZE = (640, 480)


def main() -> None:
    """Writes the pictures."""
    rig = room(4, 3.5, size=SIZE, arc_deg=250, seed=2)
    stills, lenses = [], []
    # The second camera's board never comes into the lower left.
    for number, (camera, skipped) in enumerate(((rig.cameras[0], False), (rig.cameras[1], True))):
        renderer = BoardCamera(
            replace(camera, rotation=np.eye(3), translation=np.zeros(3)), BOARD, number
        )
        poses = [
            pose
            for pose in held_poses(90, number, (1.0, 1.7))
            if not skipped or pose[1][0] > 0.3 or pose[1][1] < -0.2
        ]
        pictures = {
            f"{index:02d}.png": renderer.picture(pose) for index, pose in enumerate(poses[:24])
        }
        views = {name: BOARD.find(picture) for name, picture in pictures.items()}
        intrinsics = calibrate_intrinsics(BOARD, views, camera=camera.name)
        lenses.append(Lens(camera.name, intrinsics, views))
        stills.append(
            [pictures[line.picture] for line in intrinsics.pictures if line.left_out is None][3:6]
        )
        print(camera.name, *intrinsics.advice, sep="\n  ")
    strip = np.hstack(
        [cv2.resize(still, (320, 240), interpolation=cv2.INTER_AREA) for still in stills[0]]
    )
    cv2.imwrite(str(IMAGES / "calibration_stills.jpg"), strip, [cv2.IMWRITE_JPEG_QUALITY, 80])
    (IMAGES / "calibration_coverage.png").write_bytes(png(coverage_picture(lenses)))
    views = board_views(rig, BOARD, 80, 0.2)
    floor = {camera.name: camera.project(BOARD.points_m @ FACE_UP.T)[0] for camera in rig}
    view = next(iter(views["moment_0"].values()))
    views["floor"] = {name: replace(view, pixels=pixels) for name, pixels in floor.items()}
    (IMAGES / "calibration_rig.png").write_bytes(
        png(rig_picture(calibrate_extrinsics(BOARD, without_poses(rig), views, floor="floor").rig))
    )


if __name__ == "__main__":
    main()
