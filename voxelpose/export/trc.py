"""TRC, the marker files of OpenSim and Pose2Sim: written, and read as known joint positions.

Axis map of what is written: x = y, y = z, z = x of the world (y up), metres. It is Pose2Sim's, so
that its files and ours from one calibration lie on each other. A person who faces the world's +y
faces OpenSim's +x, as its models do.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import LAB_FROM_WORLD
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import every_frame, named_points

POSE2SIM_AXES = "yzx"
"""Which axes of the world a TRC's x, y and z are, where Pose2Sim or `voxelpose export` wrote it."""

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "meters": 1.0, "millimeters": 0.001}
_CENTRE = {"pelvis": ("midhip", "hip", "chip"), "neck": (), "head_top": ("head", "vertex")}


def write_trc(motion: Motion, path: Path) -> None:
    """Writes the points of `named_points` as TRC; axis map as said above.

    Every frame from the first to the last pose has a row, numbered from 1 as the recording's frames
    are from 0. In lost frames the cells hold NaN, which OpenSim takes for markers that were not
    seen (empty cells at the end of a row stop its reader).

    Args:
        motion: at least one pose.
        path: the file.
    """
    names, positions = named_points(motion)
    rows = dict(
        zip(
            motion.frames.tolist(),
            (positions @ LAB_FROM_WORLD.T).reshape(len(motion), -1),
            strict=True,
        )
    )
    frames = every_frame(motion)
    rate = f"{motion.fps:.10g}"
    about = {
        "DataRate": rate,
        "CameraRate": rate,
        "NumFrames": len(frames),
        "NumMarkers": len(names),
        "Units": "m",
        "OrigDataRate": rate,
        "OrigDataStartFrame": frames[0] + 1,
        "OrigNumFrames": len(frames),
    }
    axes = "\t".join(f"{axis}{number}" for number in range(1, len(names) + 1) for axis in "XYZ")
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{path.name}\n")
        file.write("\t".join(about) + "\n" + "\t".join(map(str, about.values())) + "\n")
        file.write("Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\n" + f"\t\t{axes}\n\n")
        for frame in frames.tolist():
            cells = (
                [f"{value:.6f}" for value in rows[frame]]
                if frame in rows
                else ["NaN"] * (3 * len(names))
            )
            file.write("\t".join([str(frame + 1), f"{frame / motion.fps:.6f}", *cells]) + "\n")


def read_trc(
    path: Path, axes: str = POSE2SIM_AXES, markers: Mapping[str, str] | None = None
) -> NDArray[np.float64]:
    """Reads the joints of a TRC.

    Args: path: the file. Frame 1 of it is frame 0 of the recording, as Pose2Sim numbers them. axes:
        which axes of the world the file's x, y and z are, with a minus for those that run against
        it: `yzx`, `xz-y`, `xyz`. markers: the marker that stands for a joint of `LANDMARK_NAMES`,
        where its name does not say it. Names such as `left_hip`,
            `LHip`, `hip_l`, `LHJC` do, and `MidHip`, `Head` as keypoint detectors mean them. A
            pelvis that is missing is put between the hips.

    Returns:
        (T, 15, 3) float64, world, metres; NaN where a marker was not seen.

    Raises:
        InputError: the file cannot be read, its unit is unknown, or a joint has no marker.
    """
    names, frames, points = _read_points(path)
    columns: dict[str, int] = {}
    for joint in LANDMARK_NAMES:
        column = _marker(joint, names, markers or {}, path)
        if column is not None:
            columns[joint] = column
    if "pelvis" not in columns and {"left_hip", "right_hip"} <= set(columns):
        middle = points[:, [columns["left_hip"], columns["right_hip"]]].mean(axis=1, keepdims=True)
        columns["pelvis"], points = len(names), np.concatenate([points, middle], axis=1)
    missing = [joint for joint in LANDMARK_NAMES if joint not in columns]
    if missing:
        raise InputError(
            f"{path} has no marker for {', '.join(missing)}: say which with --markers"
            f" {missing[0]}=NAME; it has {', '.join(names)}"
        )
    found = np.full((frames[-1] + 1, len(LANDMARK_NAMES), 3), np.nan)
    found[frames] = (
        points[:, [columns[joint] for joint in LANDMARK_NAMES]] @ _world_from_file(axes).T
    )
    return found


def _read_points(path: Path) -> tuple[list[str], NDArray[np.int64], NDArray[np.float64]]:
    """Returns marker names, frame numbers from 0, and (F, K, 3) positions in the file's axes,
    metres.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        about = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
        head = next(row for row, line in enumerate(lines) if line.startswith("Frame#"))
        names = [name.strip() for name in lines[head].split("\t")[2:] if name.strip()]
        unit = about["Units"].strip()
        rows = [line.split("\t") for line in lines[head + 2 :] if line.strip()]
        width = 2 + 3 * len(names)
        cells = np.array(
            [
                [float(cell) if cell.strip() else np.nan for cell in (row + [""] * width)[:width]]
                for row in rows
            ]
        )
        frames = cells[:, 0].astype(np.int64) - 1
        if unit.lower() not in _METRES:
            raise InputError(f"{path} says the unit {unit!r}: make it m, cm or mm")
        if (np.diff(frames, prepend=-1) <= 0).any():
            raise InputError(f"{path} must number its frames upward from 1")
    except (OSError, ValueError, IndexError, KeyError, StopIteration) as error:
        raise InputError(
            f"{path} cannot be read as TRC: {error or 'no line begins with Frame#'}"
        ) from error
    return names, frames, _METRES[unit.lower()] * cells[:, 2:].reshape(len(cells), len(names), 3)


def _marker(joint: str, names: Sequence[str], told: Mapping[str, str], path: Path) -> int | None:
    if joint in told:
        if told[joint] not in names:
            raise InputError(f"{path} has no marker {told[joint]!r}: it has {', '.join(names)}")
        return names.index(told[joint])
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


def _world_from_file(axes: str) -> NDArray[np.float64]:
    found = re.findall(r"(-?)([xyz])", axes)
    if "".join(map("".join, found)) != axes or sorted(axis for _, axis in found) != ["x", "y", "z"]:
        raise InputError(
            f"--axes {axes} is not understood: give x, y and z in some order, as in {POSE2SIM_AXES}"
            " or xz-y"
        )
    turn = np.zeros((3, 3))
    for column, (minus, axis) in enumerate(found):
        turn["xyz".index(axis), column] = -1.0 if minus else 1.0
    if np.linalg.det(turn) < 0:
        raise InputError(
            f"--axes {axes} would exchange left and right: turn one of its signs round"
        )
    return turn
