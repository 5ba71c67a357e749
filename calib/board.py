"""Calibration boards: description, and detection of their corners in images.

A board's own frame lies in its plane: x along a row of corners, y down the columns, z into the
board, so that a camera that sees its face has z pointing away. Corners are numbered row by row.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray, check_array
from calib.errors import InputError
from calib.marker_layout import marked_squares, seen_layout
from calib.tuning import BOARDS

Image = NDArray[np.uint8]
Effort = Literal["quick", "patient", "thorough"]

_MIN_CORNERS = 6
_MAX_COARSE_PX = 1000


@dataclass(frozen=True, eq=False)
class BoardView:
    """A board detected in an image."""

    ids: NDArray[np.int64]  #: (N,) int64, corner numbers.
    pixels: FloatArray  #: (N, 2) float64, px, the corners.
    size: tuple[int, int]  #: Image (width, height), px.


@dataclass(frozen=True)
class Board:
    """A checkerboard, or a ChArUco one if `marker_m` is given. InputError where it cannot be."""

    columns: int  #: Inner corners along a row (one fewer than squares).
    rows: int  #: Inner corners along a column.
    square_m: float  #: Side of a square, m.
    marker_m: float | None = None  #: Side of a ChArUco marker, m; None for a plain checkerboard.
    dictionary: str = "DICT_4X4_50"  #: Name of OpenCV's ArUco dictionary.
    legacy: bool = False
    """Whether a ChArUco board with an even number of rows of squares begins with a marker, as
    boards by OpenCV before 4.6 do."""

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 2:
            raise InputError(
                f"a board needs at least 2 x 2 inner corners, not {self.columns} x {self.rows}:"
                " count where four squares meet"
            )
        if not (np.isfinite(self.square_m) and self.square_m > 0):
            raise InputError(
                f"the side of a square must be a length in metres, not {self.square_m}"
            )
        if self.marker_m is not None and not 0 < self.marker_m < self.square_m:
            raise InputError(
                f"the marker ({self.marker_m} m) must be smaller than the square"
                f" ({self.square_m} m)"
            )
        if not hasattr(cv2.aruco, self.dictionary):
            raise InputError(
                f"no ArUco dictionary {self.dictionary!r}: take one of OpenCV's, for example"
                " DICT_4X4_50"
            )
        needed = (self.columns + 1) * (self.rows + 1) // 2
        if self.marker_m is not None and needed > (known := len(self._dictionary.bytesList)):
            raise InputError(
                f"{self.dictionary} has {known} markers, the board needs {needed}: take a larger"
                " one, such as DICT_4X4_250"
            )

    @property
    def points_m(self) -> FloatArray:
        """(columns * rows, 3) float64, m: the corners in the board's frame."""
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        return (
            np.column_stack([column.ravel(), row.ravel(), np.zeros(column.size)]).astype(np.float64)
            * self.square_m
        )

    @property
    def is_symmetric(self) -> bool:
        """Whether half a turn maps the pattern onto itself, so that its two ends look alike."""
        return self.marker_m is None and (self.columns + self.rows) % 2 == 0

    def find(self, picture: Image, effort: Effort = "thorough") -> BoardView | str:
        """Detects the board's corners in an image, or says why it has no usable board.

        Args:
            picture: (H, W) or (H, W, 3) uint8.
            effort: "quick" gives up early where no board is likely (about 10 ms); "patient" always
                runs the detector (ten times as long); "thorough" then tries a second detector (a
                hundred times as long).
        """
        check_array("picture", picture, ("H", "W", 3)[: max(picture.ndim, 2)], np.uint8)
        grey = _grey(picture)
        return self._find_charuco(grey) if self.marker_m else self._find_checkerboard(grey, effort)

    def other_board(self, picture: Image) -> str | None:
        """Describes another board in an image without this one: with other numbers of corners or
        other markers. None: no board.
        """
        if self.marker_m is not None:
            return self._other_markers(picture)
        flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
        success, _, meta = cv2.findChessboardCornersSBWithMeta(_grey(picture), (3, 3), flags)
        if not success or meta is None or sorted(meta.shape) == sorted((self.columns, self.rows)):
            return None
        detected, requested = (
            f"{max(numbers)} x {min(numbers)}"
            for numbers in (meta.shape[:2], (self.columns, self.rows))
        )
        wrong = zip(sorted(meta.shape[:2]), sorted((self.columns, self.rows)), strict=True)
        missing = [expected - count for count, expected in wrong]
        if min(missing) >= 0 and missing != [1, 1]:
            return (
                f"only {detected} of {requested} inner corners are to be made out: part of it"
                " hidden or in bad light, or are the numbers wrong?"
            )
        return (
            f"a board with {detected} inner corners is there, not {requested}: count where four"
            " squares meet, not squares"
        )

    def as_printed(self, picture: Image) -> "Board | None":
        """This ChArUco board as an image shows it: as it is, of the older pattern, with rows and
        columns exchanged, or both. None: the image does not tell, or shows none of these.
        """
        if self.marker_m is None:
            return None
        ids, corners_px = self._markers(_grey(picture), self.dictionary)
        layout = seen_layout(ids, corners_px, self.marker_m / self.square_m)
        turned = replace(self, columns=self.rows, rows=self.columns)
        boards = (replace(one, legacy=legacy) for one in (self, turned) for legacy in (False, True))
        fitting = (board for board in (self, *boards) if board._layout == layout)
        return next((board for board in fitting if ids.max() < board._marker_count), None)

    def print_words(self, given: "Board") -> str:
        """What a board that `as_printed` gave is otherwise than the one that was given."""
        size = f"{self.columns} x {self.rows}"
        exchanged = f"its rows and columns are exchanged (it has {size} inner corners)"
        older = "its pattern is that of OpenCV before 4.6, which begins with a marker"
        words = [exchanged] * ((self.columns, self.rows) != (given.columns, given.rows))
        words += [older] * self._layout[1]
        return f"the board is taken as it is seen: {', and '.join(words)}"

    @property
    def _layout(self) -> tuple[int, bool]:
        """Squares in a row, and whether the first one has a marker."""
        return self.columns + 1, self.legacy and self.rows % 2 == 1

    @property
    def _marker_count(self) -> int:
        across, first = self._layout
        squares = across * (self.rows + 1)
        return (squares + first) // 2

    @staticmethod
    def _markers(grey: Image, dictionary: str) -> tuple[NDArray[np.int64], FloatArray]:
        """Numbers (N,) and corners (N, 4, 2), px, of the markers of a dictionary in an image."""
        known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
        corners, ids, _ = cv2.aruco.ArucoDetector(known).detectMarkers(grey)
        numbers = np.zeros(0, np.int64) if ids is None else ids.ravel().astype(np.int64)
        return numbers, np.array(corners, np.float64).reshape(-1, 4, 2)

    def _other_markers(self, picture: Image) -> str | None:
        """Names the board in the image, by the dictionary with most of its markers."""
        grey = _grey(picture)
        known = {
            getattr(cv2.aruco, name): name
            for name in dir(cv2.aruco)
            if name.startswith("DICT_A") or name.endswith("_1000")  # which hold the smaller ones
        }
        markers = {name: self._markers(grey, name) for name in known.values()}
        best = max(markers, key=lambda name: len(markers[name][0]))
        ids, corners_px = markers[best]
        if len(ids) < _MIN_CORNERS or self.marker_m is None:
            return None
        kind = best.removesuffix("1000")
        sizes = (f"{kind}{count}" for count in (50, 100, 250, 1000) if ids.max() < count)
        best = next((name for name in sizes if hasattr(cv2.aruco, name)), best)
        if self.dictionary.startswith(kind) and ids.max() < len(self._dictionary.bytesList):
            best = self.dictionary
        layout = seen_layout(ids, corners_px, self.marker_m / self.square_m)
        if best == self.dictionary and layout in (None, self._layout):
            return None
        size = ""
        if layout is not None:
            down = int(marked_squares(*layout, int(ids.max()) + 1)[-1, 1])
            size = (
                f", of a board with {layout[0] - 1} inner corners in a row and {down} rows or more"
            )
        return (
            f"markers 0 to {ids.max()} of {best} are there{size}; not {self.columns} x {self.rows}"
            f" inner corners with {self.dictionary}"
        )

    @cached_property
    def charuco(self) -> cv2.aruco.CharucoBoard:
        """The board as OpenCV's object."""
        squares = (self.columns + 1, self.rows + 1)
        board = cv2.aruco.CharucoBoard(
            squares, self.square_m, self.marker_m or self.square_m / 2, self._dictionary
        )
        board.setLegacyPattern(self.legacy)
        return board

    @property
    def _dictionary(self) -> cv2.aruco.Dictionary:
        """The dictionary as OpenCV's object."""
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))

    def _find_charuco(self, grey: Image) -> BoardView | str:
        """Detects ChArUco corners, any subset of them."""
        pixels, ids = self._charuco_corners(grey)
        if len(ids) < _MIN_CORNERS:
            if len(self._charuco_corners(np.ascontiguousarray(grey[:, ::-1]))[1]) >= _MIN_CORNERS:
                return "the picture is mirrored: switch off the camera's mirror (selfie) option"
            return (
                f"no board with {self.columns} x {self.rows} inner corners and markers of"
                f" {self.dictionary} found ({len(ids)} corners, {_MIN_CORNERS} are needed):"
                " dictionary, board numbers, light?"
            )
        spread = np.linalg.matrix_rank(self.points_m[ids, :2] - self.points_m[ids[0], :2])
        if spread < 2:
            return "the corners that were found lie on one line: show more of the board"
        return BoardView(ids, pixels, grey.shape[::-1])

    def _charuco_corners(self, grey: Image) -> tuple[FloatArray, NDArray[np.int64]]:
        """Pixels (N, 2) and numbers (N,) of the ChArUco corners."""
        corners, ids, _, _ = cv2.aruco.CharucoDetector(self.charuco).detectBoard(grey)
        if corners is None or ids is None:
            return np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
        return corners.reshape(-1, 2).astype(np.float64), ids.ravel().astype(np.int64)

    def _find_checkerboard(self, grey: Image, effort: Effort) -> BoardView | str:
        """Detects all corners of a plain board."""
        fault = (
            f"no board with {self.columns} x {self.rows} inner corners found: all of it in view,"
            " flat and evenly lit?"
        )
        detectors = (
            partial(self._fast_corners, give_up=True),
            partial(self._fast_corners, give_up=False),
            self._slow_corners,
        )
        for detector in detectors[: {"quick": 1, "patient": 2, "thorough": 3}[effort]]:
            corners = detector(grey)
            if corners is None:
                continue
            fault = self._fault(grey, corners)
            if fault is None:
                ordered = self._ordered(grey, corners)
                return BoardView(np.arange(len(corners)), ordered, grey.shape[::-1])
        return fault

    def _fast_corners(self, grey: Image, give_up: bool) -> FloatArray | None:
        """Detects corners in a reduced image and refines them in the original one.

        Args:
            grey: (H, W) uint8.
            give_up: Whether to stop early where no board is likely.
        """
        scale = min(1.0, _MAX_COARSE_PX / max(grey.shape))
        small = grey
        if scale < 1:
            small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        flags = (
            cv2.CALIB_CB_ADAPTIVE_THRESH
            | cv2.CALIB_CB_NORMALIZE_IMAGE
            | (cv2.CALIB_CB_FAST_CHECK if give_up else 0)
        )
        success, corners = cv2.findChessboardCorners(small, (self.columns, self.rows), flags=flags)
        if not success:
            return None
        pixels = ((corners.reshape(-1, 2) + 0.5) / scale - 0.5).astype(np.float32)
        half = int(np.clip(0.3 * self._spacing_px(pixels), 2, 25))
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)
        return (
            cv2.cornerSubPix(grey, pixels.reshape(-1, 1, 2), (half, half), (-1, -1), stop)
            .reshape(-1, 2)
            .astype(np.float64)
        )

    def _slow_corners(self, grey: Image) -> FloatArray | None:
        """Detects corners by OpenCV's sector-based detector."""
        flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
        success, corners = cv2.findChessboardCornersSB(grey, (self.columns, self.rows), flags=flags)
        return corners.reshape(-1, 2).astype(np.float64) if success else None

    def _spacing_px(self, pixels: NDArray[np.floating]) -> float:
        """Shortest distance between neighbouring corners, px."""
        grid = pixels.reshape(self.rows, self.columns, 2)
        return float(min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)))

    def _fault(self, grey: Image, corners: FloatArray) -> str | None:
        """Reason to reject detected corners, or None."""
        spacing = self._spacing_px(corners)
        if spacing < BOARDS.least_square_px:
            return (
                f"squares of {spacing:.0f} px are too small: come nearer or record in a higher"
                " resolution"
            )
        homography, _ = cv2.findHomography(self.points_m[:, :2], corners)
        if homography is None:
            return "what was found is no flat grid"
        flat = cv2.perspectiveTransform(self.points_m[None, :, :2], homography)[0]
        bend = float(np.linalg.norm(flat - corners, axis=1).max()) / spacing
        if bend > BOARDS.bend:
            return (
                f"what was found is no flat grid (off by {bend:.2f} squares): part of the board"
                " hidden, or something else like a board?"
            )
        statistics = cv2.estimateChessboardSharpness(
            grey, (self.columns, self.rows), corners.astype(np.float32).reshape(-1, 1, 2)
        )[0]
        edge_px = float(np.asarray(statistics).ravel()[0])
        blur = edge_px / spacing
        if blur > BOARDS.blur and edge_px > 4:
            return (
                f"blurred (edges {edge_px:.0f} px wide on squares of {spacing:.0f} px): hold the"
                " board still, more light"
            )
        return None

    def _ordered(self, grey: Image, corners: FloatArray) -> FloatArray:
        """Corners numbered from the end where the first inner square is dark.

        The order is then the same in every image, unless the board is symmetric.
        """
        grid = corners.reshape(self.rows, self.columns, 2)
        along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
        if along[0] * down[1] - along[1] * down[0] < 0:
            grid = grid[:, ::-1]  # the order was that of a mirrored board
        if not self.is_symmetric:
            centres = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
            column, row = np.clip(
                np.rint(centres).astype(int), 0, [grey.shape[1] - 1, grey.shape[0] - 1]
            ).transpose(2, 0, 1)
            level = grey[row, column].astype(np.float64)
            even = np.add.outer(np.arange(self.rows - 1), np.arange(self.columns - 1)) % 2 == 0
            if level[even].mean() > level[~even].mean():
                grid = grid[::-1, ::-1]
        return grid.reshape(-1, 2)


def _grey(picture: Image) -> Image:
    if picture.ndim == 2:
        return picture
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def view_between(
    board: Board, before: BoardView, after: BoardView, fraction: float
) -> BoardView | None:
    """View of a moving board at a time between two frames of one camera.

    Args:
        fraction: Time passed since the earlier frame, 0 to 1 of that between the two.

    Returns:
        The corners that both show, moved in straight lines; None if these are too few.
    """
    ids, first, second = np.intersect1d(before.ids, after.ids, return_indices=True)
    if len(ids) < _MIN_CORNERS:
        return None
    start, end = before.pixels[first], after.pixels[second]
    if board.is_symmetric:
        # The order may be reversed from frame to frame: then all corners seem to run far.
        run = np.linalg.norm(end - start, axis=1).mean()
        if run > np.linalg.norm(end[::-1] - start, axis=1).mean():
            end = end[::-1]
    return BoardView(ids, (1 - fraction) * start + fraction * end, before.size)
