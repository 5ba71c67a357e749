"""Draws the board on the floor with its axes: `python -m docs.figures.board_on_floor` writes
docs/images/board_on_floor.png.

The axes are those of `calibrate extrinsics --floor`; a test finds the drawn board and its corners.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.board_scene import board_picture
from calib.board import Board
from calib.camera import Camera
from docs.figures.drawing import INK, QUIET, arrow, blank, centred, save
from voxelpose.view.images.canvas import Colour, Image, dots, write_text

BOARD = Board(8, 5, 0.1)
WORLD_FROM_BOARD = np.diag([1.0, -1.0, -1.0])  # z of the board points into the floor
CAMERA_M = np.array([-0.75, -1.55, 1.15])

_SIZE = (620, 460)
_SQUARE_PX = 44
_AXES: tuple[tuple[str, Colour], ...] = (
    ("x", (40, 40, 200)),
    ("y", (50, 140, 30)),
    ("z", (200, 100, 30)),
)


def view_camera() -> Camera:
    """The camera of the right picture."""
    ahead = np.array([0.36, -0.2, 0.02]) - CAMERA_M
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    matrix = np.array([[790.0, 0, _SIZE[0] / 2], [0, 790.0, _SIZE[1] / 2 + 20], [0, 0, 1]])
    return Camera("view", _SIZE, matrix, np.zeros(0), rotation, -rotation @ CAMERA_M)


def board_seen(camera: Camera) -> Image:
    """Picture of the board that lies on the floor, its first corner at the origin."""
    sheet = board_picture(BOARD, 60)
    floor = np.array([(-2, -2), (9, -2), (9, 6), (-2, 6)]) * BOARD.square_m  # with its margin
    corners, _ = camera.project(np.column_stack([floor, np.zeros(4)]) @ WORLD_FROM_BOARD.T)
    height, width = sheet.shape
    edges = np.array([(0, 0), (width, 0), (width, height), (0, height)], np.float32) - 0.5
    homography = cv2.getPerspectiveTransform(edges, corners.astype(np.float32))
    image = blank(*_SIZE) - np.uint8(26)
    seen, inside = (
        cv2.warpPerspective(layer, homography, _SIZE) for layer in (sheet, np.full_like(sheet, 255))
    )
    return np.where(inside[..., None] == 255, seen[..., None], image)


def from_above() -> Image:
    """The sheet as it is printed, with its first corner and the floor's axes."""
    panel = blank(*_SIZE)
    sheet = cv2.cvtColor(board_picture(BOARD, _SQUARE_PX), cv2.COLOR_GRAY2BGR)
    left, top = 68, 104
    panel[top : top + sheet.shape[0], left : left + sheet.shape[1]] = sheet
    first = np.array([left + 2 * _SQUARE_PX, top + 2 * _SQUARE_PX], float) - 0.5
    for (name, colour), end in zip(_AXES, ((2.5, 0.0), (0.0, -2.5)), strict=False):
        tip = first + np.array(end) * _SQUARE_PX
        arrow(panel, np.stack([first, tip]), colour, 4)
        write_text(panel, name, int(tip[0]) + 16, int(tip[1]) + 6, 22, colour, True)
    dots(panel, first[None], 8, _AXES[2][1])
    for corner in (0, 7, 39):
        at = first + np.array([corner % 8, corner // 8]) * _SQUARE_PX
        dots(panel, at[None], 4, (20, 160, 250))
        _label(panel, str(corner), at + np.array([9, 20]))
    centred(panel, "The face from above: --board 8x5 counts inner corners", _SIZE[0] / 2, 34, 17)
    centred(panel, "corner 0 is at the edge with two black corner squares", 370, 94, 14, QUIET)
    return panel


def on_floor() -> Image:
    """The board on the floor, seen by a camera."""
    camera = view_camera()
    panel = board_seen(camera)
    origin = camera.project(np.zeros((1, 3)))[0][0]
    for axis, (name, colour) in enumerate(_AXES):
        tip = camera.project(np.eye(3)[axis][None] * 0.32)[0][0]
        arrow(panel, np.stack([origin, tip]), colour, 4)
        write_text(panel, name, int(tip[0]) + 10, int(tip[1]) - 4, 22, colour, True)
    dots(panel, origin[None], 6, INK)
    centred(panel, "On the floor, face up: z points up, the floor is z = 0", 310, 34, 17)
    return panel


def main() -> None:
    """Writes the picture."""
    save(np.concatenate([from_above(), on_floor()], axis=1), "board_on_floor.png")


def _label(panel: Image, text: str, at: NDArray[np.float64]) -> None:
    x, y = (int(v) for v in at)
    cv2.rectangle(panel, (x - 2, y - 13), (x + 9 * len(text) + 1, y + 3), (255, 255, 255), -1)
    write_text(panel, text, x, y, 15, (10, 110, 200), True)


if __name__ == "__main__":
    main()
