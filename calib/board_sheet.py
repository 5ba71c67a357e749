"""Printable calibration boards, to scale."""

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calib.board import Board
from calib.errors import InputError
from calib.storage.atomic import write_whole

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas

_MARGIN_M = 8 / 1000  # printers leave about 5 mm; boards are found by the white around them
_FOOT_M = 12 / 1000
_RULER_M = 1 / 10


def largest_square_m(columns: int, rows: int, paper: str) -> float:
    """Longest side of a square, m, in whole millimetres, at which a board fits a paper size.

    Args:
        paper: Its name, such as a4 or letter.
    """
    return max(_square_that_fits(columns, rows, page) for page in _pages(paper))


def write_pdf(board: Board, path: Path, paper: str | None = None) -> tuple[float, float]:
    """Writes a one-page PDF: the board to scale, its numbers, and a ruler to check the print;
    returns the page's width and height, m. InputError where the board does not fit the paper, or
    the file cannot be written.

    Args:
        path: The file. A failure leaves no partial file.
        paper: Its name, such as a4; portrait or landscape as the board fits better; None for a page
            of the size that the board needs.
    """
    from reportlab.lib.units import mm
    from reportlab.pdfgen.canvas import Canvas

    columns, rows, square = board.columns + 1, board.rows + 1, board.square_m
    if paper is None:
        margin = max(_MARGIN_M, square)
        page = max(columns * square, _RULER_M) + 2 * margin, rows * square + 2 * margin + _FOOT_M
    else:
        page = max(
            _pages(paper), key=lambda page: _square_that_fits(board.columns, board.rows, page)
        )
        fits = _square_that_fits(board.columns, board.rows, page)
        if square > fits + 1e-9:
            raise InputError(
                f"{columns} x {rows} squares of {1000 * square:g} mm do not fit on {paper.upper()}:"
                f" take squares of {1000 * fits:g} mm, fewer of them, or a larger paper"
            )
    left, bottom = (
        (page[0] - columns * square) / 2,
        _FOOT_M + (page[1] - _FOOT_M - rows * square) / 2,
    )
    width, height = (length * 1000 * mm for length in page)
    sheet = io.BytesIO()
    canvas = Canvas(sheet, pagesize=(width, height), pageCompression=0, invariant=1)
    canvas.scale(1000 * mm, 1000 * mm)
    for x, y, side_x, side_y, level in _rectangles(board):
        canvas.setFillGray(level)
        canvas.rect(left + x, bottom + rows * square - y - side_y, side_x, side_y, stroke=0, fill=1)
    canvas.setFillGray(0)
    _ruler(canvas, (page[0] - _RULER_M) / 2)
    text = _caption(board)
    size = min(0.0035, 0.0035 * 0.9 * page[0] / canvas.stringWidth(text, "Helvetica", 0.0035))
    canvas.setFont("Helvetica", size)
    canvas.drawCentredString(page[0] / 2, 0.0115, text)
    canvas.save()
    write_whole(path, sheet.getvalue())
    return page


def _pages(paper: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Width and height, m, of a paper size in portrait and landscape orientation."""
    from reportlab.lib import pagesizes
    from reportlab.lib.units import mm

    short, long = (side / (1000 * mm) for side in getattr(pagesizes, paper.upper()))
    return (short, long), (long, short)


def _square_that_fits(columns: int, rows: int, page: tuple[float, float]) -> float:
    """Longest side of a square on a page, m, in whole millimetres, with half a square of margin."""
    width, height = page[0] - 2 * _MARGIN_M, page[1] - 2 * _MARGIN_M - _FOOT_M
    side = min(
        width / (columns + 1),
        height / (rows + 1),
        page[0] / (columns + 2),
        (page[1] - _FOOT_M) / (rows + 2),
    )
    return math.floor(1000 * side + 1e-6) / 1000


def _rectangles(board: Board) -> Iterator[tuple[float, float, float, float, int]]:
    """Yields the filled rectangles: left, top, width and height, m, from the board's upper left
    corner, and 0 for black or 1 for white.
    """
    square = board.square_m
    for row, column in np.ndindex(board.rows + 1, board.columns + 1):
        if (row + column) % 2 == 0:
            yield column * square, row * square, square, square, 0
    if board.marker_m is None:
        return
    dictionary = board.charuco.getDictionary()
    modules = dictionary.markerSize + 2
    side = board.marker_m / modules
    for number, corners in zip(
        np.asarray(board.charuco.getIds()).ravel(), board.charuco.getObjPoints(), strict=True
    ):
        left, top = (
            float(value) for value in np.asarray(corners).reshape(-1, 3)[:, :2].min(axis=0)
        )
        yield left, top, board.marker_m, board.marker_m, 0
        for row, column in np.argwhere(dictionary.generateImageMarker(int(number), modules)):
            yield left + column * side, top + row * side, side, side, 1


def _caption(board: Board) -> str:
    """Description of the board and its nominal lengths."""
    kind = (
        "checkerboard"
        if board.marker_m is None
        else f"ChArUco {board.dictionary}, markers {1000 * board.marker_m:g} mm,"
    )
    millimetres = 1000 * board.square_m
    return (
        f"{kind} {board.columns} x {board.rows} inner corners, squares {millimetres:g} mm. Print at"
        f" 100 %. Check with a ruler: {board.columns + 1} squares ="
        f" {(board.columns + 1) * millimetres:g} mm, {board.rows + 1} squares ="
        f" {(board.rows + 1) * millimetres:g} mm, the line = {1000 * _RULER_M:g} mm"
    )


def _ruler(canvas: "Canvas", left: float) -> None:
    """Draws a line with a tick every 10 mm."""
    canvas.setLineWidth(0.0002)
    canvas.line(left, 0.007, left + _RULER_M, 0.007)
    for tick in range(11):
        x = left + tick * _RULER_M / 10
        canvas.line(x, 0.007, x, 0.0095 if tick % 5 == 0 else 0.0085)
