"""Lens calibration of one camera from images of a board: focal lengths, centre and distortion."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.adjust import BundleScene, Observations, adjust, ideal_poses, rms_px
from calib.board import Board, BoardView
from calib.camera import Camera, FloatArray
from calib.errors import InputError
from calib.tuning import AGREEMENT, BOARDS

LensKind = Literal["pinhole", "rational", "fisheye"]

_MIN_PICTURES = 4
_COVERAGE_GRID = 8
_EDGE_CELLS = 2
_ROUNDED_PX = 1 / 2  # largest error of what is known to whole pixels
# Of a focal length, by what markers near the corners do in all pictures alike: over 32 drawn boards
# -0.1 to 0.1 %, by the part of a picture in which corners are refined.
_BY_MARKERS = 1 / 1000


@dataclass(frozen=True)
class PictureError:
    """Reprojection error of one picture."""

    picture: str
    corners: int
    rms_px: float
    left_out: str | None = None  #: Why the picture was not used; None if it was.


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """A calibrated lens."""

    camera: Camera  #: The camera with this lens, in the origin.
    rms_px: float
    """Root mean square distance of detected and reprojected corners in the pictures used."""
    pictures: tuple[PictureError, ...]  #: Error of each picture, in the given order.
    focal_error_px: FloatArray  #: (2,) float64, standard errors of the focal lengths.
    coverage: NDArray[np.int64]  #: (8, 8) int64, number of corners in each cell of the image.

    @property
    def advice(self) -> list[str]:
        """Suggestions for a better recording; empty if there are none."""
        suggestions = []
        if gap := _uncovered(self.coverage):
            suggestions.append(
                f"{gap} of the picture: hold the board there too, distortion is a guess there"
            )
        if self.rms_px > 1:
            suggestions.append(
                f"an error of {self.rms_px:.1f} px is much: is the board flat, are its numbers"
                " right, was it held still?"
            )
        if np.any(self.focal_error_px > 0.005 * np.diag(self.camera.matrix)[:2]):
            suggestions.append(
                "the focal length is uncertain by more than 0.5 %: tilt the board more (30 to 45"
                " degrees), both ways"
            )
        return suggestions


def calibrate_intrinsics(
    board: Board,
    views: Mapping[str, BoardView | str],
    lens: LensKind = "pinhole",
    camera: str = "camera",
) -> Intrinsics:
    """Calibrates one camera. InputError where too few pictures show the board, sizes differ, or no
    plausible lens fits.

    Pictures with outlying errors (more than 2.5 times the median and more than 0.5 px) are excluded
    one by one, worst first, and named in the table.

    Args:
        lens: "pinhole" (k1 k2 p1 p2), "rational" (eight terms, for wide lenses) or "fisheye".
    """
    good = {name: view for name, view in views.items() if isinstance(view, BoardView)}
    lines = {
        name: PictureError(name, 0, np.nan, view)
        for name, view in views.items()
        if isinstance(view, str)
    }
    sizes = {view.size for view in good.values()}
    if len(sizes) > 1:
        first = {view.size: name for name, view in reversed(good.items())}
        listed = ", ".join(f"{first[size]} {size[0]}x{size[1]}" for size in sorted(sizes))
        turned = any(size[::-1] in sizes - {size} for size in sizes)
        remedy = "turn those back that were turned, a lens has the sensor's pixels"
        raise InputError(
            f"camera {camera}: pictures of different sizes ({listed}):"
            f" {remedy if turned else 'use one size'}"
        )
    size = sizes.pop() if sizes else (0, 0)
    while True:
        if len(good) < _MIN_PICTURES:
            raise InputError(_too_few(camera, len(good), len(views), lines))
        calibrated, errors, deviations = _solve(board, list(good.values()), size, lens, camera)
        rms = dict(zip(good, errors, strict=True))
        worst = max(rms, key=lambda name: rms[name])
        median = float(np.median(errors))
        if rms[worst] <= max(_ROUNDED_PX, AGREEMENT.culprit_gain * median):
            break
        lines[worst] = PictureError(
            worst,
            len(good[worst].ids),
            rms[worst],
            f"{rms[worst] / median:.1f} times the others' error",
        )
        del good[worst]
    _check_plausible(calibrated)
    lines |= {name: PictureError(name, len(view.ids), rms[name]) for name, view in good.items()}
    counts = np.array([len(view.ids) for view in good.values()])
    total = float(np.sqrt((counts * errors**2).sum() / counts.sum()))
    table = tuple(lines[name] for name in views)
    return Intrinsics(calibrated, total, table, deviations, corner_coverage(good.values(), size))


def lens_error_px(board: Board, camera: Camera, views: Sequence[BoardView]) -> float:
    """Root mean square reprojection error, px, of a lens as it is, in pictures of a board of the
    size at which it was calibrated.
    """
    lens = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
    seen = [
        (view, poses[0])
        for view in views
        if (poses := ideal_poses(lens, board.points_m[view.ids], view.pixels))
    ]
    if not seen:
        return float("nan")
    owner = np.repeat(np.arange(len(seen)), [len(view.ids) for view, _ in seen])
    points = np.concatenate([board.points_m[view.ids] for view, _ in seen])
    pixels = np.concatenate([view.pixels for view, _ in seen])
    turns, shifts = (np.array([pose[part] for _, pose in seen]) for part in (0, 1))
    scene = BundleScene((lens,), turns, shifts)
    adjusted = adjust(scene, Observations(np.zeros_like(owner), owner, points, pixels), "boards")
    return rms_px(adjusted.residuals_px)


def _solve(
    board: Board, views: list[BoardView], size: tuple[int, int], lens: LensKind, camera: str
) -> tuple[Camera, FloatArray, FloatArray]:
    """The camera, rms errors (V,) px of the views, and standard errors (2,) px of focal lengths."""
    scene = _start(board, views, size, lens, camera)
    counts = [len(view.ids) for view in views]
    owner = np.repeat(np.arange(len(views)), counts)
    points = np.concatenate([board.points_m[view.ids] for view in views])
    pixels = np.concatenate([view.pixels for view in views])
    adjusted = adjust(scene, Observations(np.zeros_like(owner), owner, points, pixels), "lenses")
    calibrated = adjusted.scene.cameras[0]
    errors = np.array(
        [rms_px(adjusted.residuals_px[owner == index]) for index in range(len(views))]
    )
    # The solver's parameters are logarithms of the focal lengths.
    variances = np.diag(adjusted.covariances[0])[:2] + (board.marker_m is not None) * _BY_MARKERS**2
    deviations = np.sqrt(variances) * np.diag(calibrated.matrix)[:2]
    return calibrated, errors, deviations


def _start(
    board: Board, views: list[BoardView], size: tuple[int, int], lens: LensKind, camera: str
) -> BundleScene:
    """Initial values: the best of a series of focal lengths, without distortion, centre in the
    middle.
    """
    best: tuple[float, BundleScene] | None = None
    for focal in max(size) * np.geomspace(0.2, 8, 24):
        matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
        terms = np.zeros(8 if lens == "rational" else 4)
        candidate = Camera(camera, size, matrix, terms, np.eye(3), np.zeros(3), lens == "fisheye")
        poses = [
            ideal_poses(candidate, board.points_m[view.ids], view.pixels, refine=False)
            for view in views
        ]
        if not all(poses):
            continue
        best_poses = [board_poses[0] for board_poses in poses]
        error = focal * float(np.median([pose[2] for pose in best_poses]))
        if best is None or error < best[0]:
            best = (
                error,
                BundleScene(
                    (candidate,),
                    np.array([pose[0] for pose in best_poses]),
                    np.array([pose[1] for pose in best_poses]),
                ),
            )
    if best is None:
        raise InputError(
            f"camera {camera}: no {lens} lens fits these pictures: are the board's numbers right?"
        )
    return best[1]


def _too_few(camera: str, good: int, given: int, lines: Mapping[str, PictureError]) -> str:
    """Message on too few pictures, with the most frequent reason."""
    reasons = [line.left_out for line in lines.values() if line.left_out]
    common = f" ({max(set(reasons), key=reasons.count)})" if reasons else ""
    return f"camera {camera}: {good} of {given} pictures serve, {_MIN_PICTURES} are needed{common}"


def _check_plausible(camera: Camera) -> None:
    """Refuses a wild focal length and a centre outside the image."""
    width, height = size = camera.size
    focal, centre = np.diag(camera.matrix)[:2], camera.matrix[:2, 2]
    if not (
        (focal > 0.1 * max(size)).all()
        and (focal < 50 * max(size)).all()
        and 0 < centre[0] < width
        and 0 < centre[1] < height
        and 0.8 < focal[0] / focal[1] < 1.25
    ):
        raise InputError(
            f"camera {camera.name}: the result is absurd (focal lengths {focal[0]:.0f},"
            f" {focal[1]:.0f}, centre {centre[0]:.0f}, {centre[1]:.0f} px): tilt the board in more"
            " pictures and fill the image"
        )


def corner_coverage(views: Iterable[BoardView], size: tuple[int, int]) -> NDArray[np.int64]:
    """Number of corners of views, (8, 8) int64, in each cell of an image (width, height) px."""
    pixels = np.concatenate([np.zeros((0, 2)), *(view.pixels for view in views)])
    column, row = np.clip(pixels / size * _COVERAGE_GRID, 0, _COVERAGE_GRID - 1).astype(int).T
    counts = np.zeros((_COVERAGE_GRID, _COVERAGE_GRID), dtype=np.int64)
    np.add.at(counts, (row, column), 1)
    return counts


def _uncovered(coverage: NDArray[np.int64]) -> str | None:
    """Names the quarters, or else the edges, of the image with no or hardly any corners."""
    half = len(coverage) // 2
    quarters = {
        f"{down} {across}": coverage[rows, columns]
        for down, rows in (("upper", slice(None, half)), ("lower", slice(half, None)))
        for across, columns in (("left", slice(None, half)), ("right", slice(half, None)))
    }
    edges = {
        "upper": coverage[:_EDGE_CELLS],
        "lower": coverage[-_EDGE_CELLS:],
        "left": coverage[:, :_EDGE_CELLS],
        "right": coverage[:, -_EDGE_CELLS:],
    }
    for regions, template in ((quarters, "in the {} quarter"), (edges, "along the {} edge")):
        fractions = {name: float((cells > 0).mean()) for name, cells in regions.items()}
        for limit, amount in ((0.0, "no corners "), (BOARDS.sparse, "hardly any corners ")):
            if sparse := [name for name, fraction in fractions.items() if fraction <= limit]:
                return amount + template.format(" and the ".join(sparse))
    return None
