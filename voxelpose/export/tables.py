"""Tables as CSV and arrays as NPZ, for spreadsheets, R, MATLAB and Python."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import HUMAN
from silhouette_core.motion.anatomical import AnatomicalAngles, anatomical_angles
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.motion import Motion
from voxelpose.export.joints import column_names, filled_column


def write_wide_joints(motion: Motion, path: Path) -> None:
    """Writes joints_wide.csv: frame,time_s,pelvis_x_m,pelvis_y_m,... with one row per pose.

    Positions are in world coordinates, metres. Frames without a pose have no row. Where some were
    filled, the last column, `filled`, is 1 for them.
    """
    names = [f"{joint}_{axis}_m" for joint in motion.model.tree.landmark_names for axis in "xyz"]
    _write(motion, names, motion.landmarks().reshape(len(motion), -1), 6, path)


def write_angles(motion: Motion, path: Path) -> None:
    """Writes angles.csv: frame,time_s,pelvis_tilt_deg,... with one row per pose.

    The angles are those of `silhouette_core.motion.anatomical`, in degrees, of a body on a person's
    tree; then those of all joints that a person does not have. Frames without a pose have no row;
    those filled are marked as in joints_wide.csv.
    """
    model, known = motion.model, AnatomicalAngles((), np.zeros((len(motion), 0)))
    if is_person_tree(model.tree):
        known = anatomical_angles(motion)
    person = HUMAN.dof_names if known.names else ()
    own = [k for k, name in enumerate(model.dof_names) if name not in person]
    names = [*known.names, *(model.dof_names[k] for k in own)]
    degrees = np.hstack([known.degrees, np.degrees(motion.angles_rad[:, own])])
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
        anatomical = {"anatomical_deg": angles.degrees, "anatomical_names": np.array(angles.names)}
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
            root_quaternion=motion.root_quaternion,
            angles_rad=motion.angles_rad,
            angle_names=np.array(model.dof_names),
            **anatomical,
            part_names=np.array(model.names),
            part_rotation=rotation,
            part_origin=origin,
            parents=model.parents,
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
