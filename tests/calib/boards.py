"""Synthetic boards for tests; most of them serve the benchmarks too."""

import cv2
import numpy as np

from benchmarks.board_scene import (
    CHECKERBOARD,
    FACE_UP,
    board_views,
    lens_views,
    looking_at,
    room,
    seen,
    without_poses,
)
from calib.board import Board

__all__ = [
    "CHECKERBOARD",
    "FACE_UP",
    "board_views",
    "drawn",
    "lens_views",
    "looking_at",
    "room",
    "seen",
    "without_poses",
]


def drawn(board: Board, square_px: int = 60, margin_px: int = 80) -> np.ndarray:
    """Draws a plain checkerboard, grey on white, seen straight on."""
    row, column = np.indices((board.rows + 1, board.columns + 1))
    squares = np.where((row + column) % 2 == 0, 30, 220).astype(np.uint8)
    picture = cv2.copyMakeBorder(
        np.kron(squares, np.ones((square_px, square_px), np.uint8)),
        *[margin_px] * 4,
        cv2.BORDER_CONSTANT,
        value=220,
    )
    return picture
