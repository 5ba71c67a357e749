"""From pictures of a board to one camera's lens: focal lengths, centre and distortion, with a table
that says how good each picture was.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.adjust import BundleScene, Observations, adjust, ideal_poses, rms_px
from calib.board import Board, BoardView, Refusal
from calib.camera import Camera
from calib.errors import InputError

FloatArray = NDArray[np.float64]
LensKind = Literal["pinhole", "rational", "fisheye"]

_MIN_PICTURES = 4
_OUTLIER = 2.5  # times the median picture's error
_ALWAYS_GOOD_PX = 0.5  # a picture this good is never an outlier
_COVERAGE_GRID = 8
_EDGE = 2  # cells
_THIN = 0.25  # of a part's cells


@dataclass(frozen=True)
class PictureError:
    """One line of the reprojection table: a picture, its corners and error (px, root mean square),
    and why it was left out, if it was.
    """

    picture: str
    corners: int
    rms_px: float
    left_out: str | None = None


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """A calibrated lens.

    Attributes: size: Image (width, height), px. matrix: (3, 3) float64, px. distortion: (n,)
        float64, OpenCV's order. fisheye: Whether it is OpenCV's fisheye model. rms_px: Root mean
        square distance between seen and reprojected corners over the pictures used. pictures: The
        table, in the order given. focal_error_px: Standard errors of the focal lengths (2,), px.
        coverage: (8, 8) int64, how many corners fell into each part of the image.
    """

    size: tuple[int, int]
    matrix: FloatArray
    distortion: FloatArray
    fisheye: bool
    rms_px: float
    pictures: tuple[PictureError, ...]
    focal_error_px: FloatArray
    coverage: NDArray[np.int64]

    @property
    def advice(self) -> list[str]:
        """What a better recording would do, in words; empty where there is nothing to say."""
        said = []
        if gap := _uncovered(self.coverage):
            said.append(
                f"{gap} of the picture: hold the board there too, distortion is a guess there"
            )
        if self.rms_px > 1:
            said.append(
                f"an error of {self.rms_px:.1f} px is much: is the board flat, are its numbers"
                " right, was it held still?"
            )
        if np.any(self.focal_error_px > 0.005 * np.diag(self.matrix)[:2]):
            said.append(
                "the focal length is uncertain by more than 0.5 %: tilt the board more (30 to 45"
                " degrees), both ways"
            )
        return said


def calibrate_intrinsics(
    board: Board,
    views: Mapping[str, BoardView | Refusal],
    lens: LensKind = "pinhole",
    camera: str = "camera",
) -> Intrinsics:
    """Calibrates one camera.

    Pictures whose error stands out (more than 2.5 times the median and more than 0.5 px) are left
    out one by one, worst first, and named in the table.

    Args:
        board: The board.
        views: What `Board.find` gave for each picture, by its name.
        lens: "pinhole" (k1 k2 p1 p2), "rational" (eight terms, for wide lenses) or "fisheye".
        camera: The camera's name, for messages.

    Returns:
        The lens and its table.

    Raises:
        InputError: Too few pictures show the board, sizes differ, or no believable lens fits.
    """
    good = {name: view for name, view in views.items() if isinstance(view, BoardView)}
    lines = {
        name: PictureError(name, 0, np.nan, view.reason)
        for name, view in views.items()
        if isinstance(view, Refusal)
    }
    sizes = {view.size for view in good.values()}
    if len(sizes) > 1:
        first = {view.size: name for name, view in reversed(good.items())}
        told = ", ".join(f"{first[size]} {size[0]}x{size[1]}" for size in sorted(sizes))
        raise InputError(f"camera {camera}: pictures of different sizes ({told}): use one size")
    size = sizes.pop() if sizes else (0, 0)
    while True:
        if len(good) < _MIN_PICTURES:
            raise InputError(_too_few(camera, len(good), len(views), lines))
        matrix, distortion, errors, deviations = _solve(
            board, list(good.values()), size, lens, camera
        )
        rms = dict(zip(good, errors, strict=True))
        worst = max(rms, key=lambda name: rms[name])
        median = float(np.median(errors))
        if rms[worst] <= max(_ALWAYS_GOOD_PX, _OUTLIER * median):
            break
        lines[worst] = PictureError(
            worst,
            len(good[worst].ids),
            rms[worst],
            f"{rms[worst] / median:.1f} times the others' error",
        )
        del good[worst]
    _believable(camera, matrix, size)
    lines |= {name: PictureError(name, len(view.ids), rms[name]) for name, view in good.items()}
    counts = np.array([len(view.ids) for view in good.values()])
    total = float(np.sqrt((counts * errors**2).sum() / counts.sum()))
    coverage = _coverage(good, size)
    table = tuple(lines[name] for name in views)
    return Intrinsics(
        size, matrix, distortion, lens == "fisheye", total, table, deviations, coverage
    )


def _solve(
    board: Board, views: list[BoardView], size: tuple[int, int], lens: LensKind, camera: str
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Returns matrix (3, 3), distortion (n,), each view's rms (V,) px and the focal lengths'
    standard errors (2,), px.
    """
    scene = _start(board, views, size, lens, camera)
    counts = [len(view.ids) for view in views]
    owner = np.repeat(np.arange(len(views)), counts)
    points = np.concatenate([board.points_m[view.ids] for view in views])
    pixels = np.concatenate([view.pixels for view in views])
    adjusted = adjust(scene, Observations(np.zeros_like(owner), owner, points, pixels), "lenses")
    found = adjusted.scene.cameras[0]
    errors = np.array(
        [rms_px(adjusted.residuals_px[owner == index]) for index in range(len(views))]
    )
    # The solver's focal numbers are logarithms.
    deviations = np.sqrt(np.diag(adjusted.covariances[0])[:2]) * np.diag(found.matrix)[:2]
    return found.matrix, found.distortion, errors, deviations


def _start(
    board: Board, views: list[BoardView], size: tuple[int, int], lens: LensKind, camera: str
) -> BundleScene:
    """Tries a row of focal lengths for an undistorted lens with its centre in the middle, and keeps
    the one that fits the boards best.
    """
    best: tuple[float, BundleScene] | None = None
    for focal in max(size) * np.geomspace(0.2, 8, 24):
        matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
        terms = np.zeros(8 if lens == "rational" else 4)
        guess = Camera(camera, size, matrix, terms, np.eye(3), np.zeros(3), lens == "fisheye")
        poses = [
            ideal_poses(guess, board.points_m[view.ids], view.pixels, refine=False)
            for view in views
        ]
        if not all(poses):
            continue
        firsts = [found[0] for found in poses]
        error = focal * float(np.median([pose[2] for pose in firsts]))
        if best is None or error < best[0]:
            best = (
                error,
                BundleScene(
                    (guess,),
                    np.array([pose[0] for pose in firsts]),
                    np.array([pose[1] for pose in firsts]),
                ),
            )
    if best is None:
        raise InputError(
            f"camera {camera}: no {lens} lens fits these pictures: are the board's numbers right?"
        )
    return best[1]


def _too_few(camera: str, good: int, given: int, lines: Mapping[str, PictureError]) -> str:
    """Says that there are too few pictures, with the most frequent reason."""
    reasons = [line.left_out for line in lines.values() if line.left_out]
    common = f" ({max(set(reasons), key=reasons.count)})" if reasons else ""
    return f"camera {camera}: {good} of {given} pictures serve, {_MIN_PICTURES} are needed{common}"


def _believable(camera: str, matrix: FloatArray, size: tuple[int, int]) -> None:
    """Refuses lenses that cannot be.

    Raises:
        InputError: The matrix has NaN, a wild focal length or a centre outside the image.
    """
    width, height = size
    focal, centre = np.diag(matrix)[:2], matrix[:2, 2]
    sane = (
        np.isfinite(matrix).all()
        and (focal > 0.1 * max(size)).all()
        and (focal < 50 * max(size)).all()
    )
    if not (
        sane
        and 0 < centre[0] < width
        and 0 < centre[1] < height
        and 0.8 < focal[0] / focal[1] < 1.25
    ):
        found = (
            f"focal lengths {focal[0]:.0f}, {focal[1]:.0f}, centre {centre[0]:.0f},"
            f" {centre[1]:.0f} px"
        )
        raise InputError(
            f"camera {camera}: the result is absurd ({found}): tilt the board in more pictures and"
            " fill the image"
        )


def _coverage(views: Mapping[str, BoardView], size: tuple[int, int]) -> NDArray[np.int64]:
    """Counts corners in each cell of a grid over the image."""
    pixels = np.concatenate([view.pixels for view in views.values()])
    column, row = np.clip(pixels / size * _COVERAGE_GRID, 0, _COVERAGE_GRID - 1).astype(int).T
    counts = np.zeros((_COVERAGE_GRID, _COVERAGE_GRID), dtype=np.int64)
    np.add.at(counts, (row, column), 1)
    return counts


def _uncovered(coverage: NDArray[np.int64]) -> str | None:
    """Says in which quarter, or else along which edge of the image there are no or hardly any
    corners.
    """
    half = len(coverage) // 2
    quarters = {
        f"{down} {across}": coverage[rows, columns]
        for down, rows in (("upper", slice(None, half)), ("lower", slice(half, None)))
        for across, columns in (("left", slice(None, half)), ("right", slice(half, None)))
    }
    edges = {
        "upper": coverage[:_EDGE],
        "lower": coverage[-_EDGE:],
        "left": coverage[:, :_EDGE],
        "right": coverage[:, -_EDGE:],
    }
    for parts, words in ((quarters, "in the {} quarter"), (edges, "along the {} edge")):
        shares = {name: float((cells > 0).mean()) for name, cells in parts.items()}
        for most, how_many in ((0.0, "no corners "), (_THIN, "hardly any corners ")):
            if thin := [name for name, share in shares.items() if share <= most]:
                return how_many + words.format(" and the ".join(thin))
    return None
