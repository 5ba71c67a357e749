"""Tables as CSV and arrays as NPZ, for spreadsheets, R, MATLAB and Python.

joints.csv has of a person the 15 joints of the HumanEva protocol, of another body its own
landmarks; one row per frame and joint. hypotheses.csv has the most probable poses of every frame.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.documents import csv_rows
from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.anatomical import AnatomicalAngles, anatomical_angles
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.joint_files import FARTHEST_M, LARGEST_CSV, column_names
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.smoothing import continuous_quaternions

_HEADER = "frame,time_s,joint,x_m,y_m,z_m,confidence"
HYPOTHESES = "hypotheses.csv"
_HYPOTHESIS_COLUMNS = ("frame", "rank", "probability", "joint", "x_m", "y_m", "z_m")


def write_joints(motion: Motion, path: Path) -> None:
    """Writes joint positions in world coordinates (axes of the calibration), metres. Frames without
    a pose have no rows; where some were filled, they have the confidence 0, and the last column,
    `filled`, is 1 for them.
    """
    heading, _ = filled_column(motion)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(_HEADER + heading + "\n")
        file.writelines(_joint_rows(motion))


def write_people_joints(motions: Sequence[Motion], path: Path) -> None:
    """Writes the joints of several people as `write_joints`, one person after the other, without
    the column `filled`; the first column, `person`, has their numbers, from 1 on.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"person,{_HEADER}\n")
        for person, motion in enumerate(motions, 1):
            file.writelines(f"{person},{row}" for row in _joint_rows(motion, marked=False))


def _joint_rows(motion: Motion, marked: bool = True) -> Iterator[str]:
    positions, confidence = motion.landmarks(), motion.landmark_confidence()
    names, (_, marks) = column_names(motion.model.tree.landmark_names), filled_column(motion)
    for row, frame in enumerate(motion.frames):
        start, mark = f"{frame},{motion.time_s[row]:.6f}", marks[row] if marked else ""
        for joint, name in enumerate(names):
            x, y, z = positions[row, joint]
            yield f"{start},{name},{x:.6f},{y:.6f},{z:.6f},{confidence[row, joint]:.3f}{mark}\n"


def filled_column(motion: Motion) -> tuple[str, list[str]]:
    """Heading and cells of the column `filled`, with their commas; empty where no frame was."""
    if not motion.filled.any():
        return "", [""] * len(motion)
    return ",filled", [f",{int(filled)}" for filled in motion.filled]


def write_wide_joints(motion: Motion, path: Path) -> None:
    """Writes joints_wide.csv: frame,time_s,pelvis_x_m,pelvis_y_m,... with one row per pose.

    Positions are in world coordinates, metres. Frames without a pose have no row. Where some were
    filled, the last column, `filled`, is 1 for them.
    """
    names = [f"{joint}_{axis}_m" for joint in motion.model.tree.landmark_names for axis in "xyz"]
    _write(motion, names, motion.landmarks().reshape(len(motion), -1), 6, path)


def write_angles(motion: Motion, path: Path) -> None:
    """Writes angles.csv: frame,time_s,pelvis_tilt_deg,... with one row per pose.

    The angles are those of `silhouette_core.motion.anatomical`, in degrees and without jumps from
    180 to -180, of a body on a person's tree; then those of all joints that a person does not have.
    Frames without a pose have no row; those filled are marked as in joints_wide.csv.
    """
    model, known = motion.model, AnatomicalAngles((), np.zeros((len(motion), 0)))
    if is_person_tree(model.tree):
        known = anatomical_angles(motion)
    person = HUMAN.dof_names if known.names else ()
    others = [k for k, name in enumerate(model.tree.dof_names) if name not in person]
    names = [*known.names, *(model.tree.dof_names[k] for k in others)]
    degrees = np.hstack([known.degrees, np.degrees(motion.angles_rad[:, others])])
    degrees = np.unwrap(degrees, period=360, axis=0)
    _write(motion, [f"{name}_deg" for name in names], degrees, 3, path)


def write_npz(motion: Motion, path: Path) -> None:
    """Writes all data of a motion as NumPy arrays, compressed and without pickle.

    Axes are those of the calibration's world, as in joints.csv; metres, radians (`angles_rad`) and
    degrees (`anatomical_deg`). Arrays with one row per pose: `frames`, `time_s`, `root_m`,
    `root_quaternion` (w x y z), `angles_rad`, `anatomical_deg`, `part_rotation` (T, 27, 3, 3) world
    from part, `part_origin` (T, 27, 3) joint of every part, `landmarks` and `landmark_confidence`
    (the 15 joints of joints.csv), `filled` (whether the pose is interpolated). Other arrays: `fps`,
    `up` (3,) and `floor_m` (the floor's height along it), `conditioning` (filter and filling of
    gaps, in words), `parents`, `rest_joints` (27, 3), and the names of the columns: `part_names`,
    `angle_names`, `anatomical_names`, `landmark_names`. Frames without a pose have no row.
    """
    model, anatomical = motion.model, {}
    if is_person_tree(model.tree):
        angles = anatomical_angles(motion)
        degrees = np.unwrap(angles.degrees, period=360, axis=0)
        anatomical = {"anatomical_deg": degrees, "anatomical_names": np.array(angles.names)}
    rotation, origin = motion.parts()
    with path.open("wb") as file:  # savez would add .npz to a name without it
        np.savez_compressed(
            file,
            fps=np.float64(motion.fps),
            up=motion.up,
            floor_m=np.float64(motion.floor_m),
            frames=motion.frames,
            time_s=motion.time_s,
            root_m=motion.root_m,
            root_quaternion=continuous_quaternions(motion.root_quaternion),
            angles_rad=motion.angles_rad,
            angle_names=np.array(model.tree.dof_names),
            **anatomical,
            part_names=np.array(model.names),
            part_rotation=rotation,
            part_origin=origin,
            parents=model.tree.parents,
            rest_joints=model.joints_m,
            landmark_names=np.array(model.tree.landmark_names),
            landmarks=motion.landmarks(),
            landmark_confidence=motion.landmark_confidence(),
            filled=motion.filled,
            conditioning=conditioning_words(motion),
        )


def _write(
    motion: Motion, names: list[str], table: NDArray[np.float64], digits: int, path: Path
) -> None:
    heading, marks = filled_column(motion)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(["frame", "time_s", *column_names(names)]) + heading + "\n")
        for frame, time_s, row, mark in zip(
            motion.frames.tolist(), motion.time_s, table, marks, strict=True
        ):
            cells = [str(frame), f"{time_s:.6f}", *(f"{value:.{digits}f}" for value in row)]
            file.write(",".join(cells) + mark + "\n")


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One of several possible poses of a frame."""

    rank: int  # position in the order of probability, 1 for the most probable
    probability: float  # probability from 0 to 1
    # (L, 3) float64, world, metres, in the order of the body's landmarks; NaN where the file has no
    # row.
    joints_m: NDArray[np.float64]
    bones: NDArray[np.integer]  # (B, 2) int, pairs of joints between which a bone is drawn


def write_hypotheses(
    hypotheses: Iterable[tuple[int, NDArray, NDArray]], path: Path, tree: KinematicTree = HUMAN
) -> None:
    """Writes one row per frame, hypothesis and joint: frame,rank,probability,joint,x_m,y_m,z_m.

    Args:
        hypotheses: frame number, probabilities (n,) in descending order, and joint positions
            (n, L, 3), world, metres, of every frame.
        tree: of the body, with L landmarks; by default a person's.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(_HYPOTHESIS_COLUMNS) + "\n")
        for frame, probability, joints in hypotheses:
            for rank, (weight, points) in enumerate(zip(probability, joints, strict=True), 1):
                for name, (x, y, z) in zip(tree.landmark_names, points, strict=True):
                    file.write(f"{frame},{rank},{weight:.4f},{name},{x:.4f},{y:.4f},{z:.4f}\n")


def read_hypotheses(path: Path, tree: KinematicTree = HUMAN) -> dict[int, tuple[Hypothesis, ...]]:
    """Reads the hypotheses of every frame number, the most probable first, of a body's `tree`; a
    missing file gives none. InputError where it is damaged.
    """
    if not path.exists():
        return {}
    names = tree.landmark_names
    joints: dict[tuple[int, int], NDArray[np.float64]] = defaultdict(
        lambda: np.full((len(names), 3), np.nan)
    )
    probability: dict[tuple[int, int], float] = {}
    for line, row in enumerate(csv_rows(path, _HYPOTHESIS_COLUMNS, LARGEST_CSV), 2):
        try:
            if row["joint"] not in names:
                raise ValueError(f"there is no joint {row['joint'][:40]}")
            key = int(row["frame"]), int(row["rank"])
            position = np.array([float(row[axis]) for axis in ("x_m", "y_m", "z_m")])
            probability[key] = float(row["probability"])
            joints[key][names.index(row["joint"])] = position
            if not (0 <= probability[key] <= 1 and (np.abs(position) <= FARTHEST_M).all()):
                raise ValueError("no probability or position")
        except (KeyError, ValueError) as error:
            raise InputError(
                f"{path} line {line} is damaged ({' '.join(str(error).split())[:100]}): fit again,"
                " or remove it"
            ) from None
    hypotheses: dict[int, tuple[Hypothesis, ...]] = {}
    bones = tree.landmark_bones
    for frame, rank in sorted(joints):
        hypothesis = Hypothesis(rank, probability[frame, rank], joints[frame, rank], bones)
        hypotheses[frame] = (*hypotheses.get(frame, ()), hypothesis)
    return hypotheses
