"""Points clicked in the pictures (points.csv), what may be up, and a grid on the floor."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.points import read_points, triangulate
from calib.storage.atomic import write_whole
from calib.storage.documents import load_text
from calib.upright import AXES, UprightFrame, axis_name, cameras_worth, up_candidates
from voxelpose.setup_page.page_requests import MOST_POINTS, PointClicked

POINTS_FILE = "points.csv"
_COLUMNS = ("camera", "point", "x_px", "y_px", "x_m", "y_m", "z_m")
_LARGEST_BYTES = 50_000_000


def read_clicked(path: Path) -> list[PointClicked]:
    """Points of a points.csv; none where there is no file. InputError where it is damaged, or holds
    more points than the page can show.
    """
    if not path.exists():
        return []
    points = read_points(path)
    if len(points.pixels) > MOST_POINTS:
        raise InputError(f"{path} has {len(points.pixels)} points, the page shows {MOST_POINTS}")
    return [
        PointClicked(
            name,
            {camera: (float(x), float(y)) for camera, (x, y) in pixels.items()},
            tuple(points.known_m[name].tolist()) if name in points.known_m else None,
        )
        for name, pixels in points.pixels.items()
    ]


def check_points(points: Sequence[PointClicked]) -> None:
    """Checks that no two points have the same name. InputError where two have."""
    names = [point.name for point in points]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two points are called {twice[:60]!r}: rename one")


def save_clicked(path: Path, points: Sequence[PointClicked]) -> list[str]:
    """Writes points.csv, in which further columns of an earlier one, and rows of cameras that are
    not shown, are kept; returns the names that are clicked nowhere and so were not written.
    InputError where the file cannot be written.
    """
    others, earlier = _further_columns(path)
    text = io.StringIO()
    writer = csv.DictWriter(text, (*_COLUMNS, *others), restval="", lineterminator="\n")
    writer.writeheader()
    for point in points:
        for camera, pixel in point.pixels.items():
            row: dict[str, Any] = earlier.get((camera, point.name), {}) | {
                "camera": camera,
                "point": point.name,
                "x_px": f"{pixel[0]:.2f}".rstrip("0").rstrip("."),
                "y_px": f"{pixel[1]:.2f}".rstrip("0").rstrip("."),
            }
            if point.position_m is not None:
                row |= dict(zip(_COLUMNS[4:], map(repr, point.position_m), strict=True))
            writer.writerow(row)
    write_whole(path, text.getvalue())
    return [point.name for point in points if not point.pixels]


def point_errors(points: Sequence[PointClicked], rig: Rig) -> dict[str, dict[str, Any]]:
    """How far each click is from where the calibration puts its point: a measured one, or one
    clicked in two cameras and more, which is triangulated.

    By point: `pixels`, the expected (x, y) px and the distance `error_px` by camera; `position_m`,
    world coordinates; `measured`, whether they were typed in.
    """
    errors: dict[str, dict[str, Any]] = {}
    for point in points:
        seen = [rig[name] for name in point.pixels if name in rig]
        pixels = np.array([point.pixels[camera.name] for camera in seen]).reshape(-1, 2)
        if point.position_m is not None:
            place = np.array(point.position_m)
        elif len(seen) > 1 and all(np.isfinite(c.undistort(pixels)).all() for c in seen):
            place = triangulate(seen, pixels)
        else:
            continue
        expected: dict[str, Any] = {}
        for camera in rig:
            (pixel,), _ = camera.project(place[None])
            if not np.isfinite(pixel).all() or np.abs(pixel).max() > 1e5:
                continue
            entry: dict[str, Any] = {"expected": pixel.tolist()}
            if camera.name in point.pixels:
                entry["error_px"] = float(np.linalg.norm(pixel - point.pixels[camera.name]))
            expected[camera.name] = entry
        errors[point.name] = {
            "pixels": expected,
            "position_m": place.tolist(),
            "measured": point.position_m is not None,
        }
    return errors


def _further_columns(path: Path) -> tuple[list[str], dict[tuple[str, str], dict[str, str]]]:
    """Names of columns that are none of ours, and their texts by camera and point."""
    if not path.exists():
        return [], {}
    reader = csv.DictReader(io.StringIO(load_text(path, _LARGEST_BYTES)), skipinitialspace=True)
    others = [name for name in reader.fieldnames or () if name and name not in _COLUMNS]
    rows = {
        ((row.get("camera") or "").strip(), (row.get("point") or "").strip()): {
            name: row.get(name) or "" for name in others
        }
        for row in reader
    }
    return others, rows


def up_choices(rig: Rig) -> list[dict[str, Any]]:
    """Directions that may be up, by `name` as for --up and `worth`, 0 to 1; the axes first."""
    choices = [{"name": name, "worth": cameras_worth(rig, up)} for name, up in AXES.items()]
    for up in up_candidates(rig):
        if all(up @ axis < 0.9999 for axis in AXES.values()):
            choices.append({"name": axis_name(up), "worth": cameras_worth(rig, up)})
    return choices


def ground_lines(rig: Rig, frame: UprightFrame) -> dict[str, list[dict[str, Any]]]:
    """The grid of the floor, z = 0 of a frame, the world's axes and an upright pole of 1.8 m as the
    cameras see them: by camera, lines with `kind` (grid, middle, x, y, z, pole) and `pixels` [[x,
    y], ...].
    """
    upright = frame.rig(rig)
    x, y = _floor_centre(upright)
    lines: list[tuple[str, NDArray[np.float64]]] = []
    for offset in np.linspace(-3, 3, 13).tolist():  # metres, a line every half
        kind = "grid" if offset else "middle"
        across = np.array([[x - 3, y + offset, 0], [x + 3, y + offset, 0]])
        along = np.array([[x + offset, y - 3, 0], [x + offset, y + 3, 0]])
        lines += [(kind, across), (kind, along)]
    lines.append(("pole", np.array([[x, y, 0], [x, y, 1.8]])))
    drawn: dict[str, list[dict[str, Any]]] = {camera.name: [] for camera in rig}
    for camera in upright:
        for kind, ends in lines:
            drawn[camera.name] += _visible_pieces(camera, kind, ends)
    for camera in rig:
        for kind, axis in zip("xyz", np.eye(3), strict=True):
            drawn[camera.name] += _visible_pieces(camera, kind, np.array([np.zeros(3), axis]))
    return drawn


def _floor_centre(rig: Rig) -> tuple[float, float]:
    """Point of the floor, to whole metres, below what all cameras look at."""
    place = triangulate(list(rig), np.array([camera.matrix[:2, 2] for camera in rig]))
    if len(rig) == 1:  # where its optical axis meets the floor, if near
        camera = rig.cameras[0]
        down = -camera.rotation[2][2]
        reach = camera.center_m[2] / down if down > 0.05 else 4.0
        place = camera.center_m + camera.rotation[2] * float(np.clip(reach, 1.0, 20.0))
    return tuple(np.rint(place[:2]).tolist())


def _visible_pieces(camera: Camera, kind: str, ends: NDArray[np.float64]) -> list[dict[str, Any]]:
    """The pieces of a line that a camera sees."""
    count = int(np.linalg.norm(ends[1] - ends[0]) / 0.1) + 1  # pieces of 10 cm: lenses bend lines
    share = np.linspace(0, 1, count)[:, None]
    pixels, _ = camera.project(ends[0] + share * (ends[1] - ends[0]))
    most = 4.0 * max(camera.size)
    visible = np.abs(np.nan_to_num(pixels, nan=np.inf)).max(axis=1) < most
    cuts = np.flatnonzero(np.diff(visible)) + 1
    return [
        {"kind": kind, "pixels": [[round(x, 2), round(y, 2)] for x, y in piece.tolist()]}
        for piece, inside in zip(np.split(pixels, cuts), np.split(visible, cuts), strict=True)
        if inside[0] and len(piece) > 1
    ]
