"""In which squares a ChArUco board has its markers, by an image of them.

The squares with markers are numbered row by row. Of how many there are in a row, and whether the
first has a marker, markers that are diagonal neighbours tell: every inner corner lies between two.
"""

import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray

_LEAST_PAIRS = 3
_MOST_ACROSS = 60


def marked_squares(across: int, first: bool, count: int) -> NDArray[np.int64]:
    """Column and row (count, 2) int64 of the squares with markers 0, 1, ..., with so many squares
    in a row, of which the first has a marker or none.
    """
    row, column = np.divmod(np.arange(2 * count + across), across)
    marked = (column + row) % 2 == (0 if first else 1)
    return np.column_stack([column, row])[marked][:count]


def pairs_in_place(
    ids: NDArray[np.int64], corners_px: FloatArray, across: int, first: bool, marker: float
) -> tuple[int, int]:
    """How many diagonal neighbours among the markers in an image lie as they do on a board, and how
    many there would be.

    Args:
        ids: (N,) int64, numbers of the markers.
        corners_px: (N, 4, 2) float64, px, their corners, clockwise from the upper left one.
        across: See `marked_squares`; `first` likewise.
        marker: Side of a marker, in sides of a square.
    """
    places = marked_squares(across, first, int(ids.max(initial=0)) + 1)[ids]
    apart = places[None] - places[:, None]
    one, other = np.nonzero((np.abs(apart) == 1).all(axis=2))
    middles = corners_px.mean(axis=1)
    edges = np.stack([corners_px[:, 1] - corners_px[:, 0], corners_px[:, 3] - corners_px[:, 0]], 2)
    mean = (edges[one] + edges[other]) / 2
    flat = np.abs(np.linalg.det(mean)) > 1
    one, other, mean = one[flat], other[flat], mean[flat]
    seen = marker * np.linalg.solve(mean, (middles[other] - middles[one])[..., None])[..., 0]
    # To the nearest square: the side of a marker may be told wrongly, and lenses bend.
    right = (np.abs(seen - apart[one, other]) < 1 / 2).all(axis=1)
    return int(right.sum()) // 2, len(one) // 2


def seen_layout(
    ids: NDArray[np.int64], corners_px: FloatArray, marker: float
) -> tuple[int, bool] | None:
    """Squares in a row of the board in an image, and whether its first square has a marker; None
    where the markers do not tell, as where rows are seen in part. Arguments as of `pairs_in_place`.
    """
    best, layout = _LEAST_PAIRS - 1, None
    for across in range(3, _MOST_ACROSS):
        for first in (False, True):
            right, pairs = pairs_in_place(ids, corners_px, across, first, marker)
            if right >= best and 2 * right > pairs:
                layout = None if right == best else (across, first)
                best = right
    return layout
