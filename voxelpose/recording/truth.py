"""Known joint positions of a recording: truth.json, written and read; a TRC is read as well, and
of any body a motion file or a joints.csv.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.documents import load_text, parse_json
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import (
    FARTHEST_M,
    POSE2SIM_AXES,
    column_names,
    list_joints,
    read_joints,
    read_trc,
)
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion

TRUTH = "truth.json"
TRUE_MOTION = "truth.safetensors"
_LARGEST_BYTES = 300_000_000  # some hours


@dataclass(frozen=True, eq=False)
class KnownJoints:
    """What is known of a movement."""

    names: tuple[str, ...]  #: L names of the joints, the first of which is the root's.
    joints_m: NDArray[np.float64]
    """(T, L, 3) float64, world, metres; NaN where a position is unknown."""
    motion: Motion | None = None  #: the motion, where its joint angles are known too.


def load_truth(
    path: Path, markers: Mapping[str, str] | None = None, axes: str = POSE2SIM_AXES
) -> KnownJoints:
    """Truth of a file of any format: a person's as `read_truth` reads it, a motion (.safetensors),
    or a joints.csv with whatever joints it names. InputError where the file cannot be read.

    Args:
        markers: for a TRC, as for `read_trc`.
        axes: for a TRC, as for `read_trc`.
    """
    match path.suffix.lower():
        case ".safetensors":
            motion = read_motion(path)
            if not len(motion):
                raise InputError(f"{path} has no pose: give another file")
            names = tuple(column_names(motion.model.tree.landmark_names))
            joints_m = np.full((motion.frames[-1] + 1, len(names), 3), np.nan)
            joints_m[motion.frames] = motion.landmarks()
            return KnownJoints(names, joints_m, motion)
        case ".csv":
            names, count = list_joints(path)
            names = LANDMARK_NAMES if set(LANDMARK_NAMES) <= set(names) else names
            joints_m = read_joints(path, count, names=names)
            if not np.isfinite(joints_m).all(axis=2).any():
                raise InputError(f"{path} has no position of a joint: give another file")
            return KnownJoints(names, joints_m)
    return KnownJoints(LANDMARK_NAMES, read_truth(path, markers, axes))


def truth_of(recording: Path) -> Path | None:
    """The file of the truth in a recording's folder; None where there is none."""
    files = (recording / TRUTH, recording / TRUE_MOTION)
    return next((file for file in files if file.is_file()), None)


def write_truth(path: Path, joints_m: NDArray[np.float64], fps: float, stature_m: float) -> None:
    """Writes truth.json: `{"unit": "m", "joints": {name: [[x, y, z] per frame]}, ...}`.

    Args:
        joints_m: (T, 15, 3) float64, world, z up, metres, in the order of LANDMARK_NAMES.
    """
    joints = {name: joints_m[:, k].round(5).tolist() for k, name in enumerate(LANDMARK_NAMES)}
    document = {"fps": fps, "unit": "m", "up": "z", "stature": stature_m, "joints": joints}
    path.write_text(json.dumps(document), encoding="utf-8")


def read_truth(
    path: Path, markers: Mapping[str, str] | None = None, axes: str = POSE2SIM_AXES
) -> NDArray[np.float64]:
    """Reads known joint positions from truth.json or a TRC. InputError where the file cannot be
    read or has no position.

    Args:
        markers: for a TRC, as for `read_trc`.
        axes: for a TRC, as for `read_trc`.

    Returns:
        (T, 15, 3) float64, world, metres; NaN where a position is unknown (null in JSON, or the
        joint is left out).
    """
    truth = read_trc(path, axes, markers) if path.suffix.lower() == ".trc" else _read_json(path)
    if not np.isfinite(truth).all(axis=2).any():
        raise InputError(
            f"{path} has no position of the {len(LANDMARK_NAMES)} joints: give another file"
        )
    if (np.abs(truth) > FARTHEST_M).any():
        raise InputError(
            f"{path} holds positions beyond {FARTHEST_M / 1000:g} km: correct them or the unit"
        )
    return truth


def read_people_truth(path: Path) -> list[NDArray[np.float64]]:
    """Reads the known joint positions of everybody from truth.json, whose `people` each have
    `joints` as a single person's truth has; (T, 15, 3) float64 each, world, metres. InputError
    where the file cannot be read, or is not of several people.
    """
    document = parse_json(load_text(path, _LARGEST_BYTES), path)
    people = document.get("people") if isinstance(document, dict) else None
    if not isinstance(people, list) or not people:
        raise InputError(f"{path} does not list people: give the truth of several, as truth.json")
    unit = {"unit": document.get("unit", "m")}
    return [
        _known_joints(unit | person if isinstance(person, dict) else {}, path) for person in people
    ]


def _read_json(path: Path) -> NDArray[np.float64]:
    document = parse_json(load_text(path, _LARGEST_BYTES), path)
    if isinstance(document, dict) and "people" in document:
        raise InputError(f"{path} is of several people: give the folder of the result of them all")
    return _known_joints(document, path)


def _known_joints(document: Any, path: Path) -> NDArray[np.float64]:
    try:
        if document.get("unit", "m") != "m":
            raise InputError(f"{path} is in {str(document['unit'])[:20]!r}: convert it to metres")
        joints: dict[str, list[list[float] | None] | None] = document["joints"]
        count = max(len(joints.get(name) or ()) for name in LANDMARK_NAMES)
        unknown = [np.nan] * 3
        frames = [
            [unknown if place is None else place for place in joints.get(name) or [None] * count]
            for name in LANDMARK_NAMES
        ]
        return np.array(frames, float).reshape(len(frames), count, 3).swapaxes(0, 1)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
        raise InputError(
            f"{path} cannot be read as a truth file (joints by name, positions in metres):"
            f" {str(error)[:200]}; give another file"
        ) from error
