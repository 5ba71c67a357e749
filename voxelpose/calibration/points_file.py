"""Scene points as CSV: camera,point,x_px,y_px and, for measured points, x_m,y_m,z_m."""

import csv
from pathlib import Path

import numpy as np

from calib.errors import InputError
from calib.points import ScenePoints

_PIXELS = ("x_px", "y_px")
_METRES = ("x_m", "y_m", "z_m")


def read_points(path: Path) -> ScenePoints:
    """Reads scene points.

    A measured point has x_m, y_m and z_m (up) in at least one of its rows.

    Raises:
        InputError: The file is missing, a column is, or a row is wrong; the row is named.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read as CSV: {error}") from None
    header = rows[0].keys() if rows else ()
    if missing := [name for name in ("camera", "point", *_PIXELS) if name not in header]:
        raise InputError(
            f"{path}: no column {', '.join(missing)}: the first line must be"
            " camera,point,x_px,y_px,x_m,y_m,z_m"
        )
    pixels: dict[str, dict[str, np.ndarray]] = {}
    known: dict[str, np.ndarray] = {}
    for number, row in enumerate(rows, start=2):
        location = f"{path} line {number}"
        camera, point = ((row[key] or "").strip() for key in ("camera", "point"))
        seen = pixels.setdefault(point, {})
        if camera in seen:
            raise InputError(f"{location}: point {point} is listed twice for camera {camera}")
        seen[camera] = _numbers(row, _PIXELS, location)
        stated = [key for key in _METRES if (row.get(key) or "").strip()]
        if not stated:
            continue
        position = _numbers(row, _METRES, location)
        if point in known and not np.array_equal(known[point], position):
            raise InputError(f"{location}: point {point} has other world coordinates than before")
        known[point] = position
    return ScenePoints(pixels, known)


def _numbers(row: dict[str, str], keys: tuple[str, ...], location: str) -> np.ndarray:
    try:
        numbers = np.array([float(row[key] or "") for key in keys])
    except (KeyError, ValueError):
        numbers = np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise InputError(f"{location}: {', '.join(keys)} must be numbers")
    return numbers
