"""joints.csv: of a person the 15 joints of the HumanEva protocol, of another body its own
landmarks; one row per frame and joint.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.documents import csv_rows
from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.motion import Motion

JOINTS = "joints.csv"
_COLUMNS = ("frame", "joint", "x_m", "y_m", "z_m")
_LARGEST_BYTES = 3_000_000_000  # half a day; read row by row
FARTHEST_M = 100_000
"""Distance from the world's origin beyond which a position in a file is a mistake, m."""
_MOST_JOINTS = 1000
_HEADER = "frame,time_s,joint,x_m,y_m,z_m,confidence"


def write_joints(motion: Motion, path: Path) -> None:
    """Writes joint positions in world coordinates (axes of the calibration), metres.

    Args:
        motion: T poses; frames without a pose have no rows. Where some were filled, they have the
            confidence 0, and the last column, `filled`, is 1 for them.
    """
    positions, confidence = motion.landmarks(), motion.landmark_confidence()
    names = column_names(motion.model.tree.landmark_names)
    heading, marks = filled_column(motion)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(_HEADER + heading + "\n")
        for row, frame in enumerate(motion.frames):
            start = f"{frame},{motion.time_s[row]:.6f}"
            for joint, name in enumerate(names):
                x, y, z = positions[row, joint]
                sure = f"{confidence[row, joint]:.3f}{marks[row]}"
                file.write(f"{start},{name},{x:.6f},{y:.6f},{z:.6f},{sure}\n")


def filled_column(motion: Motion) -> tuple[str, list[str]]:
    """Heading and cells of the column `filled`, with their commas; empty where no frame was."""
    if not motion.filled.any():
        return "", [""] * len(motion)
    return ",filled", [f",{int(filled)}" for filled in motion.filled]


def column_names(names: Sequence[str]) -> list[str]:
    """Names as tables in CSV have them: without commas and quotes."""
    return [name.replace(",", "_").replace('"', "_") for name in names]


def list_joints(path: Path) -> tuple[tuple[str, ...], int]:
    """Names of the joints of a joints.csv, in their order, and one more than its last frame.

    Raises:
        InputError: the file cannot be read, or its frames are numbered as none are.
    """
    names: dict[str, None] = {}
    rows = last = 0
    for line, row in enumerate(csv_rows(path, _COLUMNS[:2], _LARGEST_BYTES), 2):
        try:
            names[row["joint"]] = None
            last = max(last, int(row["frame"]) + 1)
        except (ValueError, KeyError) as error:
            raise _unreadable(path, line, error) from error
        rows += 1
        if len(names) > _MOST_JOINTS:
            raise InputError(f"{path} names more than {_MOST_JOINTS} joints: it is no joints.csv")
    if beyond_rows(last, rows):
        raise InputError(f"{path} has {rows} rows, the last frame being {last - 1}: correct it")
    return tuple(names), last


def read_joints(
    path: Path, count: int, offset: int = 0, names: Sequence[str] = LANDMARK_NAMES
) -> NDArray[np.float64]:
    """Reads joint positions.

    Args:
        path: the CSV file; it needs the columns frame, joint, x_m, y_m and z_m.
        count: number of frames to return; rows of other frames are ignored.
        offset: number added to the file's frame numbers.
        names: L names of the joints.

    Returns:
        (count, L, 3) float64, world, metres, in the order of the names; NaN where a joint has
        no row.

    Raises:
        InputError: the file cannot be read.
    """
    number = {name: index for index, name in enumerate(names)}
    joints_m = np.full((count, len(number), 3), np.nan)
    for line, row in enumerate(csv_rows(path, _COLUMNS, _LARGEST_BYTES), 2):
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


def beyond_rows(last: float, rows: int) -> bool:
    """Whether a file's last frame is numbered so far beyond its rows that the number is a mistake:
    frames that are left out are filled in, in memory.
    """
    return last > 100_000 + 10 * rows


def _unreadable(path: Path, line: int, error: Exception) -> InputError:
    return InputError(
        f"{path} line {line} cannot be read as {','.join(_COLUMNS)}: {str(error)[:100]}: correct"
        " the row or fit again"
    )
