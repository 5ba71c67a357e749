"""Scene points as CSV: camera,point,x_px,y_px and, for measured points, x_m,y_m,z_m."""

from pathlib import Path

import numpy as np

from calib.documents import csv_rows
from calib.errors import InputError
from calib.points import ScenePoints

_LARGEST_BYTES = 50_000_000
_FARTHEST_M, _FARTHEST_PX = 100_000, 1_000_000
_LONGEST_NAME = 200
_PIXELS = ("x_px", "y_px")
_METRES = ("x_m", "y_m", "z_m")


def read_points(path: Path) -> ScenePoints:
    """Reads scene points.

    A measured point has x_m, y_m and z_m (up) in at least one of its rows.

    Raises:
        InputError: The file is missing, a column is, or a row is wrong; the row is named.
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
