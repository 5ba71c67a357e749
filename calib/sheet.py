"""A calibration board on paper, to scale."""

import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board import Board

_POINTS_PER_M = 72 / 0.0254
_MARGIN_SQUARES = 1.0
_PX_PER_SQUARE = 120  # divides evenly by the modules of every common marker
_FOOT_M = 0.012


def board_picture(board: Board, square_px: int = _PX_PER_SQUARE) -> NDArray[np.uint8]:
    """Draws a board (H, W) uint8, black on white, with a margin of one square."""
    size = ((board.columns + 1) * square_px, (board.rows + 1) * square_px)
    if board.marker_m is None:
        row, column = np.indices((board.rows + 1, board.columns + 1))
        # The first inner square dark, as `Board.find` counts.
        squares = np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8)
        picture = np.kron(squares, np.ones((square_px, square_px), dtype=np.uint8))
    else:
        picture = np.asarray(board.charuco.generateImage(size), dtype=np.uint8)
    margin = round(_MARGIN_SQUARES * square_px)
    return np.asarray(cv2.copyMakeBorder(picture, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=(255,)), dtype=np.uint8)


def write_pdf(board: Board, path: Path) -> tuple[float, float]:
    """Writes a one-page PDF whose page is just as large as the board, its margin and a line of text.

    Args:
        board: The board.
        path: Where to.

    Returns:
        The page's width and height, m, for choosing the paper.

    Raises:
        OSError: The file cannot be written.
    """
    picture = board_picture(board)
    width_m, height_m = (n / _PX_PER_SQUARE * board.square_m for n in picture.shape[::-1])
    width, height, foot = (length * _POINTS_PER_M for length in (width_m, height_m, _FOOT_M))
    kind = "checkerboard" if board.marker_m is None else f"ChArUco {board.dictionary}, markers {1000 * board.marker_m:g} mm,"
    text = (
        f"{kind} {board.columns} x {board.rows} inner corners, squares {1000 * board.square_m:g} mm: print at 100 %, then measure a square"
    )
    content = (
        f"q {width:.4f} 0 0 {height:.4f} 0 {foot:.4f} cm /Board Do Q BT /Font 8 Tf {foot:.2f} {foot / 2:.2f} Td ({text}) Tj ET".encode()
    )
    pixels = zlib.compress(picture.tobytes(), 9)
    image = (
        f"/Type /XObject /Subtype /Image /Width {picture.shape[1]} /Height {picture.shape[0]} /ColorSpace /DeviceGray /BitsPerComponent 8"
    )
    page = f"/MediaBox [0 0 {width:.4f} {height + foot:.4f}] /Contents 4 0 R"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R {page} /Resources << /XObject << /Board 5 0 R >> /Font << /Font 6 0 R >> >> >>".encode(),
        f"<< /Length {len(content)} >>\nstream\n".encode() + content + b"\nendstream",
        f"<< {image} /Filter /FlateDecode /Length {len(pixels)} >>\nstream\n".encode() + pixels + b"\nendstream",
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    written = b"%PDF-1.4\n"
    places = []
    for number, body in enumerate(objects, start=1):
        places.append(len(written))
        written += f"{number} 0 obj\n".encode() + body + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    count = len(objects) + 1
    trailer = f"xref\n0 {count}\n0000000000 65535 f \n{table}trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{len(written)}\n%%EOF\n"
    path.write_bytes(written + trailer.encode())
    return width_m, height_m + _FOOT_M
