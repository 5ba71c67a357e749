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
_FARTHEST_M = 1e5
_HEADER = "frame,time_s,joint,x_m,y_m,z_m,confidence"


def write_joints(motion: Motion, path: Path) -> None:
    """Writes joint positions in world coordinates (axes of the calibration), metres.

    Args:
        motion: T poses; frames without a pose have no rows.
        path: the CSV file.
    """
    positions, confidence = motion.landmarks(), motion.landmark_confidence()
    names = [name.replace(",", "_").replace('"', "_") for name in motion.model.tree.landmark_names]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(_HEADER + "\n")
        for row, frame in enumerate(motion.frames):
            start = f"{frame},{motion.time_s[row]:.6f}"
            for joint, name in enumerate(names):
                x, y, z = positions[row, joint]
                file.write(f"{start},{name},{x:.6f},{y:.6f},{z:.6f},{confidence[row, joint]:.3f}\n")


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
            raise InputError(
                f"{path} line {line} cannot be read as {','.join(_COLUMNS)}:"
                f" {str(error)[:100]}: correct the row or fit again"
            ) from error
    if (np.abs(joints_m) > _FARTHEST_M).any():
        raise InputError(
            f"{path} holds positions beyond {_FARTHEST_M / 1000:g} km: are they in metres?"
        )
    return joints_m
