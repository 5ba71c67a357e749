"""A printed board is to scale and is found again."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.board_scene import board_picture
from calib.board import Board, BoardView
from calib.board_sheet import largest_square_m, write_pdf
from calib.errors import InputError

BOARDS = [Board(8, 5, 0.027), Board(7, 4, 0.027, marker_m=0.02025)]
PX_PER_M = 4000


def printed(path: Path) -> np.ndarray:
    """Fills the page's rectangles, (H, W) uint8: a printer for what these pages hold."""
    text = path.read_text("latin-1")
    width, height = (
        float(number) / 72 * 0.0254
        for number in re.search(r"/MediaBox \[ 0 0 (\S+) (\S+) \]", text).groups()
    )  # type: ignore[union-attr]
    page = np.full((round(height * PX_PER_M), round(width * PX_PER_M)), 255, np.uint8)
    level = 0.0
    for grey, x, y, w, h in re.findall(r"(?:([\d.]+) g\s)|(?:n (\S+) (\S+) (\S+) (\S+) re)", text):
        if grey:
            level = float(grey)
            continue
        left, top, right, bottom = (
            round(float(value) * PX_PER_M)
            for value in (x, height - float(y) - float(h), float(x) + float(w), height - float(y))
        )
        page[top:bottom, left:right] = round(255 * level)
    return page


@pytest.mark.parametrize("board", BOARDS)
@pytest.mark.parametrize(
    ("paper", "sides_m"), [(None, None), ("a4", (0.21, 0.297)), ("letter", (0.2159, 0.2794))]
)
def test_the_page_is_to_scale_and_is_found(tmp_path, board, paper, sides_m):
    page_m = write_pdf(board, tmp_path / "board.pdf", paper)
    assert sides_m is None or sorted(page_m) == pytest.approx(sides_m)
    page = printed(tmp_path / "board.pdf")
    np.testing.assert_allclose(np.array(page.shape[::-1]) / PX_PER_M, page_m, atol=1e-3)
    result = board.find(page)
    assert isinstance(result, BoardView)
    assert len(result.ids) == board.columns * board.rows
    offsets = (result.pixels - result.pixels[0]) / PX_PER_M
    # Half a pixel of the printer above, at 4 px a millimetre.
    np.testing.assert_allclose(offsets, board.points_m[:, :2], atol=0.3e-3)
    assert [file.name for file in tmp_path.iterdir()] == ["board.pdf"]


@pytest.mark.parametrize("board", BOARDS)
def test_paper_and_picture_show_the_same(tmp_path, board):
    write_pdf(board, tmp_path / "board.pdf")
    page, picture = printed(tmp_path / "board.pdf"), board_picture(board, 120)
    square = round(board.square_m * PX_PER_M)
    height, width = (board.rows + 3) * square, (board.columns + 3) * square
    rows, columns = np.indices((height, width)) * 120 // square
    assert np.mean(page[:height, :width] != picture[rows, columns]) < 0.03  # edges


def test_what_does_not_fit_is_refused_with_what_does(tmp_path):
    assert largest_square_m(8, 5, "a4") == 0.028
    with pytest.raises(
        InputError, match="9 x 6 squares of 30 mm do not fit on A4: take squares of 28 mm"
    ):
        write_pdf(Board(8, 5, 0.03), tmp_path / "board.pdf", "a4")
    with pytest.raises(InputError, match="cannot be written"):
        write_pdf(Board(8, 5, 0.02), tmp_path / "nowhere" / "board.pdf")
    assert not list(tmp_path.iterdir())
