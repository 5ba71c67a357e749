"""Joint positions in files, read: CSV as joints.csv, and TRC, the marker files of OpenSim and
Pose2Sim.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from calib.storage.documents import csv_rows, load_text
from silhouette_core.body.joints import LANDMARK_NAMES

JOINTS = "joints.csv"
FARTHEST_M = 100_000
"""Distance from the world's origin beyond which a position in a file is a mistake, m."""
LARGEST_CSV = 3_000_000_000
"""Bytes of a table in CSV: half a day, read row by row."""
POSE2SIM_AXES = "yzx"
"""World axes to which x, y and z of a TRC by Pose2Sim or `voxelpose export` correspond."""
_COLUMNS = ("frame", "joint", "x_m", "y_m", "z_m")
_MOST_JOINTS = 1000
_LARGEST_TRC = 300_000_000  # bytes
_CENTRE = {"pelvis": ("midhip", "hip", "chip"), "neck": (), "head_top": ("head", "vertex")}


def column_names(names: Sequence[str]) -> list[str]:
    """Names as tables in CSV have them: without commas and quotes."""
    return [name.replace(",", "_").replace('"', "_") for name in names]


def list_joints(path: Path) -> tuple[tuple[str, ...], int]:
    """Names of the joints of a joints.csv, in their order, and one more than its last frame.
    InputError where the file cannot be read, or its frames are numbered as none are.
    """
    names: dict[str, None] = {}
    rows = last = 0
    for line, row in enumerate(csv_rows(path, _COLUMNS[:2], LARGEST_CSV), 2):
        try:
            names[row["joint"]] = None
            last = max(last, int(row["frame"]) + 1)
        except (ValueError, KeyError) as error:
            raise _unreadable(path, line, error) from error
        rows += 1
        if len(names) > _MOST_JOINTS:
            raise InputError(f"{path} names more than {_MOST_JOINTS} joints: it is no joints.csv")
    if _beyond_rows(last, rows):
        raise InputError(f"{path} has {rows} rows, the last frame being {last - 1}: correct it")
    return tuple(names), last


def read_joints(
    path: Path, count: int, offset: int = 0, names: Sequence[str] = LANDMARK_NAMES
) -> FloatArray:
    """Reads joint positions of a CSV file with the columns frame, joint, x_m, y_m and z_m;
    InputError where that is not possible.

    Args:
        count: number of frames to return; rows of other frames are ignored.
        offset: number added to the file's frame numbers.
        names: L names of the joints.

    Returns:
        (count, L, 3) float64, world, metres, in the order of the names; NaN where a joint has no
            row.
    """
    number = {name: index for index, name in enumerate(names)}
    joints_m = np.full((count, len(number), 3), np.nan)
    for line, row in enumerate(csv_rows(path, _COLUMNS, LARGEST_CSV), 2):
        try:
            frame = int(row["frame"]) + offset
            if row["joint"] in number and 0 <= frame < count:
                position = [float(row[axis]) for axis in _COLUMNS[2:]]
                joints_m[frame, number[row["joint"]]] = position
        except (ValueError, KeyError) as error:
            raise _unreadable(path, line, error) from error
    if (np.abs(joints_m) > FARTHEST_M).any():
        raise InputError(
            f"{path} holds positions beyond {FARTHEST_M / 1000:g} km: are they in metres?"
        )
    return joints_m


def _beyond_rows(last: float, rows: int) -> bool:
    """Whether a last frame's number is a mistake: missing frames are filled in, in memory."""
    return last > 100_000 + 10 * rows


def _unreadable(path: Path, line: int, error: Exception) -> InputError:
    return InputError(
        f"{path} line {line} cannot be read as {','.join(_COLUMNS)}: {str(error)[:100]}: correct"
        " the row or fit again"
    )


def read_trc(
    path: Path, axes: str = POSE2SIM_AXES, markers: Mapping[str, str] | None = None
) -> FloatArray:
    """Reads the joints of a TRC. Raises InputError where the file cannot be read, its unit is
    unknown, or a joint has no marker.

    Args:
        path: the file; its frame 1 is frame 0 of the recording, as in Pose2Sim.
        axes: world axes to which the file's x, y and z correspond, with a minus sign where the
            direction is opposite: `yzx`, `xz-y`, `xyz`.
        markers: marker names by joint of `LANDMARK_NAMES`, where the marker's own name is not
            recognised. Recognised names are such as `left_hip`, `LHip`, `hip_l`, `LHJC`, and
            `MidHip` and `Head` as in keypoint detectors. A missing pelvis is the midpoint of the
            hips.

    Returns:
        (T, 15, 3) float64, world, metres, in the order of LANDMARK_NAMES; NaN where a marker was
        not seen.
    """
    names, frames, points = _read_points(path)
    columns: dict[str, int] = {}
    for joint in LANDMARK_NAMES:
        column = _marker_column(joint, names, markers or {}, path)
        if column is not None:
            columns[joint] = column
    if "pelvis" not in columns and {"left_hip", "right_hip"} <= set(columns):
        middle = points[:, [columns["left_hip"], columns["right_hip"]]].mean(axis=1, keepdims=True)
        columns["pelvis"], points = len(names), np.concatenate([points, middle], axis=1)
    missing = [joint for joint in LANDMARK_NAMES if joint not in columns]
    if missing:
        raise InputError(
            f"{path} has no marker for {', '.join(missing)}: say which with --markers"
            f" {missing[0]}=NAME; it has {_listing(names)}"
        )
    joints_m = np.full((frames[-1] + 1, len(LANDMARK_NAMES), 3), np.nan)
    selected = points[:, [columns[joint] for joint in LANDMARK_NAMES]]
    joints_m[frames] = selected @ _world_from_file(axes).T
    return joints_m


def _read_points(path: Path) -> tuple[list[str], IntArray, FloatArray]:
    """Returns marker names, frame numbers from 0, and positions (F, K, 3), file's axes, metres."""
    lines = load_text(path, _LARGEST_TRC).splitlines()
    try:
        header = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
        head = next(row for row, line in enumerate(lines) if line.startswith("Frame#"))
        names = [name.strip() for name in lines[head].split("\t")[2:] if name.strip()]
        unit = header["Units"].strip().lower()
        rows = [line for line in lines[head + 2 :] if line.strip()]
        if len(names) > _MOST_JOINTS:
            raise ValueError(f"it names {len(names)} markers")
        width = 2 + 3 * len(names)
        cells = np.full((len(rows), width), np.nan)
        for row, line in enumerate(rows):
            numbers = [float(cell) if cell.strip() else np.nan for cell in line.split("\t")[:width]]
            cells[row, : len(numbers)] = numbers
    except (ValueError, IndexError, KeyError, StopIteration) as error:
        reason = " ".join(str(error).split())[:200] or "no line begins with Frame#"
        raise InputError(f"{path} cannot be read as TRC: {reason}; export it again") from error
    metres = {"m": 1.0, "cm": 0.01, "mm": 0.001, "meters": 1.0, "millimeters": 0.001}.get(unit)
    if metres is None:
        raise InputError(f"{path} says the unit {unit[:20]!r}: make it m, cm or mm")
    if not len(rows) or not names:
        raise InputError(f"{path} holds no frames or no markers: export it again")
    numbers = cells[:, 0]
    if not (numbers >= 1).all() or (np.diff(numbers, prepend=0) < 1).any():
        raise InputError(f"{path} must number its frames upward from 1")
    if _beyond_rows(numbers[-1], len(rows)):
        raise InputError(
            f"{path} has {len(rows)} frames, the last with the number {numbers[-1]:g}: correct it"
        )
    points = metres * cells[:, 2:].reshape(len(cells), len(names), 3)
    if (np.abs(points) > FARTHEST_M).any():
        raise InputError(
            f"{path} holds positions beyond {FARTHEST_M / 1000:g} km: correct them or the unit"
        )
    return names, numbers.astype(np.int64) - 1, points


def _marker_column(
    joint: str, names: Sequence[str], markers: Mapping[str, str], path: Path
) -> int | None:
    """Returns the index of the marker of a joint; None where no name is recognised."""
    if joint in markers:
        if markers[joint] not in names:
            raise InputError(f"{path} has no marker {markers[joint]!r}: it has {_listing(names)}")
        return names.index(markers[joint])
    plain = {
        re.sub(r"[^a-z0-9]", "", name.lower()): number
        for number, name in reversed(list(enumerate(names)))
    }
    side, _, kind = joint.partition("_")
    letter = side[0]
    paired = (side + kind, letter + kind, kind + letter, kind + side, f"{letter}{kind[:1]}jc")
    for name in paired if side in ("left", "right") else (joint.replace("_", ""), *_CENTRE[joint]):
        if name in plain:
            return plain[name]
    return None


def _listing(names: Sequence[str]) -> str:
    """Names for a message, as many as a line can hold."""
    more = ", ..." if len(names) > 40 else ""
    return ", ".join(name[:20] for name in names[:40]) + more


def _world_from_file(axes: str) -> FloatArray:
    """Returns the (3, 3) rotation from the file's axes to the world's."""
    signed = re.findall(r"(-?)([xyz])", axes)
    if "".join(map("".join, signed)) != axes or sorted(axis for _, axis in signed) != list("xyz"):
        raise InputError(
            f"--axes {axes} is not understood: give x, y and z in some order, as in {POSE2SIM_AXES}"
            " or xz-y"
        )
    rotation = np.zeros((3, 3))
    for column, (minus, axis) in enumerate(signed):
        rotation["xyz".index(axis), column] = -1.0 if minus else 1.0
    if np.linalg.det(rotation) < 0:
        raise InputError(f"--axes {axes} would exchange left and right: reverse one of its signs")
    return rotation
