"""Pictures and videos of a board, as they are made for a calibration."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.board_scene import FACE_UP, BoardCamera, held_poses, random_poses
from calib.board import Board
from calib.camera import Rig
from tests.sources import write_film


def film_boards(
    folder: Path,
    rig: Rig,
    board: Board,
    floor_m: np.ndarray,
    distance_m: tuple[float, float] = (1.5, 2.4),
) -> Path:
    """Writes stills of the board before each camera, stills/NAME, and videos of it being carried
    about after it lay on the floor with its middle there, walk/NAME.avi.
    """
    facing = rig.cameras[1].rotation.T
    walk = [
        (FACE_UP, floor_m),
        *((facing @ turn, place) for turn, place in random_poses(18, 3, (0, 0, 1.0), 0.4)),
    ]
    (folder / "walk").mkdir()
    for number, camera in enumerate(rig):
        film = BoardCamera(camera, board, number)
        write_film(folder / "walk" / f"{camera.name}.avi", [film.picture(pose) for pose in walk])
        own = BoardCamera(
            replace(camera, rotation=np.eye(3), translation=np.zeros(3)), board, number
        )
        stills = folder / "stills" / camera.name
        stills.mkdir(parents=True)
        for index, pose in enumerate(held_poses(12, number, distance_m)):
            cv2.imwrite(str(stills / f"{index:02d}.png"), own.picture(pose))
    return folder
