"""Camera poses from points of the scene, some of them measured in the world, and their table
in CSV: camera,point,x_px,y_px and, for measured points, x_m,y_m,z_m.

Cameras that see four measured points are located by them; points seen by two located cameras are
triangulated and locate further cameras. Bundle adjustment refines all poses and triangulated
points; measured points stay fixed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from calib.adjust import Adjustment, BundleScene, Observations, adjust, rms_px
from calib.camera import Camera, FloatArray, Rig
from calib.errors import InputError
from calib.extrinsics import Extrinsics, camera_error
from calib.pairs import shared_boards
from calib.rotation import matrix_from_rodrigues
from calib.storage.documents import csv_rows
from calib.tuning import AGREEMENT, BOARDS

_NEEDED = 4
_LARGEST_BYTES = 50_000_000
_FARTHEST_M, _FARTHEST_PX = 100_000, 1_000_000
_LONGEST_NAME = 200
_PIXELS = ("x_px", "y_px")
_METRES = ("x_m", "y_m", "z_m")


@dataclass(frozen=True, eq=False)
class ScenePoints:
    """Observed points of a scene."""

    pixels: Mapping[str, Mapping[str, FloatArray]]
    """Point -> camera -> (2,) float64, px, its image."""
    known_m: Mapping[str, FloatArray]
    """Point -> (3,) float64, m, world coordinates of the measured points; z is up."""

    def cameras(self) -> set[str]:
        """Names of all cameras that see a point."""
        return {camera for seen in self.pixels.values() for camera in seen}


def read_points(path: Path) -> ScenePoints:
    """Reads scene points. InputError where the file or a column is missing, or a row is wrong,
    which is named.

    A measured point has x_m, y_m and z_m (up) in at least one of its rows.
    """
    rows = csv_rows(path, ("camera", "point", *_PIXELS), _LARGEST_BYTES, optional=_METRES)
    pixels: dict[str, dict[str, np.ndarray]] = {}
    known: dict[str, np.ndarray] = {}
    for number, row in enumerate(rows, start=2):
        location = f"{path} line {number}"
        camera, point = (row.get(key, "").strip() for key in ("camera", "point"))
        seen = pixels.setdefault(point, {})
        if max(len(camera), len(point)) > _LONGEST_NAME:
            raise InputError(f"{location}: no name has {max(len(camera), len(point))} letters")
        if camera in seen:
            raise InputError(f"{location}: point {point} is listed twice for camera {camera}")
        seen[camera] = _numbers(row, _PIXELS, location)
        stated = [key for key in _METRES if row.get(key, "").strip()]
        if not stated:
            continue
        position = _numbers(row, _METRES, location)
        if point in known and not np.array_equal(known[point], position):
            raise InputError(f"{location}: point {point} has other world coordinates than before")
        known[point] = position
    return ScenePoints(pixels, known)


def _numbers(row: dict[str, str], keys: tuple[str, ...], location: str) -> np.ndarray:
    try:
        numbers = np.array([float(row.get(key, "")) for key in keys])
    except ValueError:
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        comma = any("," in row.get(key, "") for key in keys)
        remedy = "write them with a point, 412.5" if comma else "correct the row"
        raise InputError(f"{location}: {', '.join(keys)} must be numbers: {remedy}")
    most = _FARTHEST_PX if keys == _PIXELS else _FARTHEST_M
    if np.abs(numbers).max() > most:
        raise InputError(
            f"{location}: {', '.join(keys)} hold {np.abs(numbers).max():.3g}, beyond {most:g}:"
            " correct the row"
        )
    return numbers


def calibrate_from_points(lenses: Rig, points: ScenePoints) -> Extrinsics:
    """Estimates the poses of cameras with calibrated lenses; those that they have are ignored.
    InputError where too few points are measured, or they do not locate every camera.

    Returns:
        The rig in the world of the measured points. Standard errors are relative to that world, and
        counts are of points, not boards.
    """
    for name in sorted(points.cameras() - set(lenses.names)):
        raise InputError(
            f"points are listed for camera {name}, which has no lens calibration: calibrate its"
            " intrinsics first"
        )
    measured = [name for name in points.pixels if name in points.known_m]
    if len(measured) < _NEEDED:
        raise InputError(
            f"{len(measured)} points have world coordinates, {_NEEDED} are needed: without them the"
            " scale is unknown"
        )
    located, points_m = _start(lenses, points)
    free = [name for name in points.pixels if name in points_m and name not in points.known_m]
    board_points = {name: (number, np.zeros(3)) for number, name in enumerate(free, start=1)}
    board_points |= {name: (0, points.known_m[name]) for name in measured}
    rows = [(camera, name) for name in board_points for camera in points.pixels[name]]
    cameras = tuple(located[name] for name in lenses.names)
    number = {name: index for index, name in enumerate(lenses.names)}
    seen = Observations(
        np.array([number[camera] for camera, _ in rows]),
        np.array([board_points[name][0] for _, name in rows]),
        np.array([board_points[name][1] for _, name in rows]),
        np.array([points.pixels[name][camera] for camera, name in rows]),
    )
    # The measured points are one fixed rigid board, each other point a board of a single corner.
    shifts = np.concatenate(
        [np.zeros((1, 3)), np.array([points_m[name] for name in free]).reshape(-1, 3)]
    )
    adjusted = adjust(
        BundleScene(cameras, np.repeat(np.eye(3)[None], len(shifts), axis=0), shifts),
        seen,
        "poses",
        fixed="board",
    )
    counts = np.bincount(seen.camera, minlength=len(cameras))
    table = tuple(
        camera_error(index, adjusted, seen, int(counts[index])) for index in range(len(cameras))
    )
    unused = [name for name in points.pixels if name not in board_points]
    return Extrinsics(
        Rig(adjusted.scene.cameras),
        table,
        rms_px(adjusted.residuals_px),
        shared_boards(lenses.names, points.pixels),
        _advice(rows, adjusted, unused),
    )


def measured_errors(rig: Rig, points: ScenePoints) -> dict[str, float]:
    """Root mean square reprojection error, px, of measured points by the names of a rig's cameras
    that see some.
    """
    errors: dict[str, float] = {}
    for camera in rig:
        seen = [name for name in points.known_m if camera.name in points.pixels.get(name, {})]
        if seen:
            placed, _ = camera.project(np.array([points.known_m[name] for name in seen]))
            pixels = np.array([points.pixels[name][camera.name] for name in seen])
            errors[camera.name] = rms_px(pixels - placed)
    return errors


def _start(lenses: Rig, points: ScenePoints) -> tuple[dict[str, Camera], dict[str, FloatArray]]:
    """Initial poses of cameras and triangulated points, cameras with most points first. InputError
    where a camera has too few known points.
    """
    located: dict[str, Camera] = {}
    points_m = {
        name: np.asarray(position, dtype=np.float64) for name, position in points.known_m.items()
    }
    while len(located) < len(lenses):
        waiting = {
            camera.name: [
                name
                for name, seen in points.pixels.items()
                if camera.name in seen and name in points_m
            ]
            for camera in lenses
            if camera.name not in located
        }
        best = max(waiting, key=lambda name: len(waiting[name]))
        if len(waiting[best]) < _NEEDED:
            counts = ", ".join(f"{name} {len(names)}" for name, names in waiting.items())
            raise InputError(
                f"too few points to place {', '.join(waiting)} (points that are measured, or seen"
                f" by two placed cameras: {counts}; {_NEEDED} are needed): list more points that"
                " these cameras share with others"
            )
        names = waiting[best]
        located[best] = _locate(
            lenses[best],
            np.array([points_m[name] for name in names]),
            np.array([points.pixels[name][best] for name in names]),
        )
        for name, seen in points.pixels.items():
            both = [camera for camera in seen if camera in located]
            if name not in points.known_m and len(both) > 1:
                points_m[name] = triangulate(
                    [located[camera] for camera in both],
                    np.array([seen[camera] for camera in both]),
                )
    return located, points_m


def _locate(camera: Camera, points_m: FloatArray, pixels: FloatArray) -> Camera:
    """Locates a camera by points (N, 3) m and their images (N, 2) px.

    Source: Terzakis and Lourakis, A Consistently Fast and Globally Optimal Solution to the PnP
    Problem, 2020 (OpenCV's SOLVEPNP_SQPNP).
    """
    ideal = camera.undistort(pixels)
    good = np.isfinite(ideal).all(axis=1)
    solved, rotvec, shift = False, None, None
    side_px, many = max(camera.size), good.sum() >= _NEEDED
    if many and not any(_on_a_line(one[good], side_px) for one in (points_m, ideal)):
        solved, rotvec, shift = cv2.solvePnP(
            points_m[good], ideal[good], camera.matrix, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP
        )
    if not solved or rotvec is None or shift is None:
        raise InputError(
            f"camera {camera.name}: its points do not say where it stands: are some on one line, or"
            " outside its lens?"
        )
    return replace(
        camera,
        rotation=matrix_from_rodrigues(rotvec),
        translation=np.asarray(shift, dtype=np.float64).ravel(),
    )


def _on_a_line(points: FloatArray, side_px: int) -> bool:
    """Whether points (N, D) lie in one point or on one line: within a pixel, if they fill an image
    of this side.
    """
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= spread[0] / side_px)


def triangulate(cameras: list[Camera], pixels: FloatArray) -> FloatArray:
    """Point (3,) nearest to the rays of pixels (N, 2), one per camera."""
    rays = [camera.rays(pixel[None]) for camera, pixel in zip(cameras, pixels, strict=True)]
    origins, directions = zip(*rays, strict=True)
    return nearest_point(np.array(origins), np.concatenate(directions))


def nearest_point(origins: FloatArray, directions: FloatArray) -> FloatArray:
    """Point (3,) nearest to lines through points (N, 3) along unit vectors (N, 3)."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None]
    target = np.einsum("nij,nj->i", across, origins)
    return np.linalg.lstsq(across.sum(axis=0), target, rcond=None)[0]


def _advice(
    rows: list[tuple[str, str]], adjusted: Adjustment, unused: list[str]
) -> tuple[str, ...]:
    """Remarks on outlying points, and on those without information."""
    errors = np.linalg.norm(adjusted.residuals_px, axis=1)
    limit = max(BOARDS.robust_px, AGREEMENT.culprit_gain * float(np.median(errors)))
    remarks = [
        f"point {name} in camera {camera} is off by {error:.1f} px: mistaken for another, or"
        " measured wrongly?"
        for (camera, name), error in sorted(
            zip(rows, errors, strict=True), key=lambda line: -line[1]
        )
        if error > limit
    ]
    if unused:
        remarks.append(f"seen by one camera and not measured, so of no use: {', '.join(unused)}")
    return tuple(remarks)
