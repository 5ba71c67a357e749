"""TRC: marker files of OpenSim and Pose2Sim, written, and read as known joint positions.

Axis map of written files: x = y, y = z, z = x of the upright frame (y up), metres, as in Pose2Sim:
files of both programs made with one calibration with z up coincide. A person who faces +y faces
OpenSim's +x, as OpenSim's models do.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.documents import load_text
from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import LAB_FROM_WORLD
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import ascii_names, every_frame, named_points
from voxelpose.export.tables import FARTHEST_M, beyond_rows

POSE2SIM_AXES = "yzx"
"""World axes to which x, y and z of a TRC by Pose2Sim or `voxelpose export` correspond."""

_NAMED = "motion.trc"
_LARGEST_BYTES = 300_000_000
_MOST_MARKERS = 1000
_CENTRE = {"pelvis": ("midhip", "hip", "chip"), "neck": (), "head_top": ("head", "vertex")}


def write_trc(motion: Motion, path: Path, *, lost_rows: bool = True) -> None:
    """Writes the points of `named_points` as TRC, with the axis map above.

    Frame 1 of the file is frame 0 of the recording.

    Args:
        motion: at least one pose.
        lost_rows: whether frames without a pose have a row. Its cells then hold NaN, which OpenSim
            reads as markers that were not seen (empty cells at the end of a row stop its reader);
            at a frame that shows none its inverse kinematics stop.
    """
    motion = motion.upright()
    words, positions = named_points(motion)
    names = ascii_names(words)
    rows = dict(
        zip(
            motion.frames.tolist(),
            (positions @ LAB_FROM_WORLD.T).reshape(len(motion), -1),
            strict=True,
        )
    )
    frames = every_frame(motion) if lost_rows else motion.frames
    rate = f"{motion.fps:.10g}"
    header = {
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
        # Not the path's own name, which is another until the file is complete.
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{_NAMED}\n")
        file.write("\t".join(header) + "\n" + "\t".join(map(str, header.values())) + "\n")
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

    Raises:
        InputError: the file cannot be read, its unit is unknown, or a joint has no marker.
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


def _read_points(path: Path) -> tuple[list[str], NDArray[np.int64], NDArray[np.float64]]:
    """Returns marker names, frame numbers from 0, and positions (F, K, 3), file's axes, metres."""
    lines = load_text(path, _LARGEST_BYTES).splitlines()
    try:
        header = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
        head = next(row for row, line in enumerate(lines) if line.startswith("Frame#"))
        names = [name.strip() for name in lines[head].split("\t")[2:] if name.strip()]
        unit = header["Units"].strip().lower()
        rows = [line for line in lines[head + 2 :] if line.strip()]
        if len(names) > _MOST_MARKERS:
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
    if beyond_rows(numbers[-1], len(rows)):
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


def _world_from_file(axes: str) -> NDArray[np.float64]:
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
