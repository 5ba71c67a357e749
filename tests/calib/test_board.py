"""Finding boards, and saying why not."""

import cv2
import numpy as np
import pytest
from boards import drawn

from calib.board import Board, BoardView
from calib.errors import InputError

ODD = Board(8, 5, 0.06)
EVEN = Board(7, 5, 0.06)


def reason(found: BoardView | str) -> str:
    assert isinstance(found, str)
    return found


@pytest.mark.parametrize("board", [ODD, EVEN])
def test_corners_are_found_where_they_are(board):
    result = board.find(drawn(board))
    assert isinstance(result, BoardView)
    # The first inner corner is one square in from the margin; a pixel's centre is half a pixel from
    # its edge.
    expected = board.points_m[:, :2] / board.square_m * 60 + 80 + 60 - 0.5
    if board.is_symmetric and np.linalg.norm(result.pixels[0] - expected[0]) > 60:
        expected = expected[::-1]
    np.testing.assert_allclose(result.pixels, expected, atol=0.1)
    assert result.size == drawn(board).shape[::-1]


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_the_count_starts_at_the_same_corner_however_the_board_is_held(turns):
    picture = drawn(ODD)
    upright = ODD.find(picture)
    turned = ODD.find(np.ascontiguousarray(np.rot90(picture, turns)))
    assert isinstance(upright, BoardView) and isinstance(turned, BoardView)
    height, width = picture.shape
    x, y = upright.pixels.T
    expected = {
        0: (x, y),
        1: (y, width - 1 - x),
        2: (width - 1 - x, height - 1 - y),
        3: (height - 1 - y, x),
    }[turns]
    np.testing.assert_allclose(turned.pixels, np.column_stack(expected), atol=0.1)


def test_a_picture_in_perspective_and_colour():
    picture = cv2.cvtColor(drawn(ODD), cv2.COLOR_GRAY2BGR)
    height, width = picture.shape[:2]
    before = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    after = before + np.array([[100, 40], [-80, 0], [-30, -60], [20, 0]], np.float32)
    homography = cv2.getPerspectiveTransform(before, after)
    warped = cv2.warpPerspective(picture, homography, (width, height), borderValue=(220, 220, 220))
    result, straight = ODD.find(warped), ODD.find(picture)
    assert isinstance(result, BoardView) and isinstance(straight, BoardView)
    expected = cv2.perspectiveTransform(straight.pixels[None], homography)[0]
    np.testing.assert_allclose(result.pixels, expected, atol=0.2)


def test_every_refusal_says_why():
    picture = drawn(ODD)
    empty = np.full((300, 400), 128, np.uint8)
    assert "no board with 8 x 5 inner corners found" in reason(ODD.find(empty))
    assert "no board with 7 x 5" in reason(EVEN.find(picture, "quick"))
    small = cv2.resize(picture, None, fx=0.1, fy=0.1, interpolation=cv2.INTER_AREA)
    assert "squares of 6 px are too small" in reason(ODD.find(small))
    assert "blurred" in reason(ODD.find(cv2.GaussianBlur(picture, (0, 0), 12)))


def test_charuco_corners_are_found_even_when_part_is_hidden():
    board = Board(7, 4, 0.04, marker_m=0.03)
    picture = with_markers(board, 100)
    whole = board.find(picture)
    assert isinstance(whole, BoardView)
    expected = board.points_m[:, :2] / 0.04 * 100 + 60 + 100 - 0.5
    np.testing.assert_allclose(whole.pixels, expected, atol=0.6)
    hidden = picture.copy()
    hidden[:, 500:] = 255
    part = board.find(hidden)
    assert isinstance(part, BoardView)
    assert 6 <= len(part.ids) < 28
    np.testing.assert_allclose(part.pixels, whole.pixels[part.ids], atol=0.5)
    assert "mirrored" in reason(board.find(np.ascontiguousarray(picture[:, ::-1])))
    white = np.full((300, 400), 255, np.uint8)
    assert "markers of DICT_4X4_50 found (0 corners" in reason(board.find(white))


def test_impossible_boards_are_refused():
    for numbers, words in (
        ((1, 5, 0.06), "at least 2 x 2 inner corners, not 1 x 5"),
        ((8, 5, float("nan")), "must be a length in metres"),
        ((8, 5, 0.06, 0.07), "must be smaller than the square"),
        ((8, 5, 0.06, 0.03, "X"), "no ArUco dictionary 'X'"),
        ((12, 10, 0.06, 0.03), "DICT_4X4_50 has 50 markers, the board needs 71"),
    ):
        with pytest.raises(InputError, match=words):
            Board(*numbers)
    with pytest.raises(TypeError, match=r"picture must be \(H, W\)"):
        ODD.find(np.zeros((4, 4)))  # type: ignore[arg-type]


def test_another_board_in_the_picture_is_named():
    for rows, words in (
        (5, "only 8 x 5 of 9 x 5 inner corners are to be made out"),
        (6, "there, not 9 x 6: count where four squares meet, not squares"),
        (4, "a board with 8 x 5 inner corners is there, not 9 x 4"),
    ):
        assert words in str(Board(9, rows, 0.06).other_board(drawn(ODD)))
    assert ODD.other_board(drawn(ODD)) is None
    assert ODD.other_board(np.full((300, 400), 128, np.uint8)) is None
    marked = with_markers(Board(7, 4, 0.04, marker_m=0.03, dictionary="DICT_5X5_100"))
    seen = Board(7, 4, 0.04, marker_m=0.03).other_board(marked)
    assert seen is not None and seen.startswith("markers 0 to 19 of DICT_5X5_")
    assert seen.endswith(
        " are there, of a board with 7 inner corners in a row and 4 rows or more; not 7 x 4 inner"
        " corners with DICT_4X4_50"
    )
    larger = with_markers(Board(8, 5, 0.04, marker_m=0.03))
    asked = Board(6, 4, 0.04, marker_m=0.03)
    assert "no board with 6 x 4 inner corners" in reason(asked.find(larger))
    assert "with 8 inner corners in a row and 5 rows" in str(asked.other_board(larger))
    # What it is asked for, but for a dictionary that holds the same markers.
    assert Board(8, 5, 0.04, 0.03, "DICT_4X4_250").other_board(larger) is None


def with_markers(board: Board, square_px: int = 70) -> np.ndarray:
    """Draws a ChArUco board, seen straight on."""
    size = (square_px * (board.columns + 1), square_px * (board.rows + 1))
    picture = board.charuco.generateImage(size)
    return cv2.copyMakeBorder(picture, *[60] * 4, cv2.BORDER_CONSTANT, value=255)


@pytest.mark.parametrize(
    ("printed", "asked", "words"),
    [
        ((8, 5, False), (8, 5), ""),
        ((8, 5, True), (8, 5), "OpenCV before 4.6"),
        ((5, 8, False), (8, 5), "exchanged (it has 5 x 8 inner corners)"),
        ((8, 5, True), (5, 8), "exchanged (it has 8 x 5 inner corners), and its pattern"),
        ((7, 5, True), (7, 5), "OpenCV before 4.6"),
    ],
)
def test_boards_with_markers_are_taken_as_they_are_printed(printed, asked, words):
    columns, rows, legacy = printed
    truth = Board(columns, rows, 0.04, 0.03, legacy=legacy)
    picture, given = with_markers(truth), Board(*asked, 0.04, 0.03)
    found = given.as_printed(picture)
    assert found == truth and words in found.print_words(given)
    assert (found == given) == (not words) == isinstance(given.find(picture), BoardView)
    view = found.find(picture)
    assert isinstance(view, BoardView) and len(view.ids) == columns * rows
    expected = truth.points_m[view.ids, :2] / 0.04 * 70 + 60 + 70 - 0.5
    np.testing.assert_allclose(view.pixels, expected, atol=0.6)


def test_a_board_seen_in_part_does_not_tell_its_pattern():
    """Without the ends of its rows, the older pattern is the newer one, a square farther on."""
    given = Board(8, 5, 0.04, 0.03)
    part = with_markers(Board(8, 5, 0.04, 0.03, legacy=True))[:, : 60 + 5 * 70]
    assert isinstance(given.find(part), BoardView) and given.as_printed(part) is None
    assert ODD.as_printed(drawn(ODD)) is None
