"""A printed board is to scale and is found again."""

import re
import zlib

import numpy as np
import pytest

from calib.board import Board, View
from calib.sheet import board_picture, write_pdf


@pytest.mark.parametrize("board", [Board(8, 5, 0.03), Board(7, 4, 0.03, marker_m=0.0225)])
def test_the_page_is_to_scale_and_its_picture_is_found(tmp_path, board):
    path = tmp_path / "board.pdf"
    width_m, height_m = write_pdf(board, path)
    # One square more than inner corners, and a margin of one on each side.
    assert width_m == pytest.approx((board.columns + 3) * board.square_m)
    data = path.read_bytes()
    page = [float(number) for number in re.search(rb"/MediaBox \[([^\]]+)\]", data)[1].split()]  # type: ignore[index]
    np.testing.assert_allclose(np.array(page[2:]) / 72 * 0.0254, [width_m, height_m], atol=1e-6)
    picture = board_picture(board)
    stream = re.search(rb"/FlateDecode /Length (\d+) >>\nstream\n", data)
    assert stream is not None
    assert zlib.decompress(data[stream.end() : stream.end() + int(stream[1])]) == picture.tobytes()
    # Every object is where the table says.
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", data), start=1):
        assert data[int(place) :].startswith(f"{number} 0 obj".encode())
    found = board.find(picture)
    assert isinstance(found, View)
    np.testing.assert_allclose(found.pixels, board.points_m[found.ids, :2] / board.square_m * 120 + 240 - 0.5, atol=0.6)
