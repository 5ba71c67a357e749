"""MOT: joint coordinates for OpenSim.

Axis map: x = y, y = z, z = x of the world (y up), metres. It is Pose2Sim's, so that its files and
ours from one calibration lie on each other. A person who faces the world's +y faces OpenSim's +x,
as its models do.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import LAB_FROM_WORLD, euler_degrees, joint_rotations
from silhouette_core.motion.motion import Motion

# Where the middle of the hips lies in the pelvis of Rajagopal's model, whose person is 1.70 m tall.
_HIPS_IN_PELVIS_M = np.array([-0.056276, -0.07849, 0.0])
_MODEL_STATURE_M = 1.70

_HIPS = [LANDMARK_NAMES.index("left_hip"), LANDMARK_NAMES.index("right_hip")]

# joint: the names of its turns about z, x and y in Rajagopal et al.'s model, {} being r or l; None
# where the model has no such turn
_COORDINATES = {
    "hip": ("hip_flexion_{}", "hip_adduction_{}", "hip_rotation_{}"),
    "knee": ("knee_angle_{}", None, None),
    "ankle": ("ankle_angle_{}", "subtalar_angle_{}", None),
    "trunk": ("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
    "shoulder": ("arm_flex_{}", "arm_add_{}", "arm_rot_{}"),
    "elbow": ("elbow_flex_{}", None, "pro_sup_{}"),
    "wrist": ("wrist_flex_{}", "wrist_dev_{}", None),
}


def write_mot(motion: Motion, path: Path) -> None:
    """Writes joint coordinates as MOT, under the names and with the signs of Rajagopal et al.'s
    full-body model.

    Degrees; `pelvis_tx`, `_ty`, `_tz` in metres with the axis map above, for that model's pelvis
    scaled by stature. Turns follow each
    other as in the model: pelvis tilt, list, rotation; flexion, adduction, rotation of hip and arm;
        all continuous in time. Models of
    the gait2392 family count knee flexion negative, and have no arms. What the model lacks is left
    out: side-bending and turning of the knee, the neck, the shoulder girdle.

    Lost frames have no row; OpenSim interpolates between rows by their times.

    Args:
        motion: at least one pose.
        path: the file.
    """
    columns = mot_coordinates(motion)
    table = (
        np.column_stack([motion.frames / motion.fps, *columns.values()]).round(6) + 0.0
    )  # no -0.000000
    head = [
        "Coordinates",
        "version=1",
        f"nRows={len(table)}",
        f"nColumns={table.shape[1]}",
        "inDegrees=yes",
        "",
        "endheader",
    ]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(head) + "\n" + "\t".join(["time", *columns]) + "\n")
        file.writelines("\t".join(f"{value:.6f}" for value in row) + "\n" for row in table)


def mot_coordinates(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """Returns the columns of a MOT file, (T,) each, degrees and metres."""
    rotations = joint_rotations(motion)
    columns = dict(
        zip(
            ("pelvis_tilt", "pelvis_list", "pelvis_rotation"),
            _turns(rotations["pelvis"]),
            strict=True,
        )
    )
    hips = motion.landmarks()[:, _HIPS].mean(axis=1) @ LAB_FROM_WORLD.T
    offset = _HIPS_IN_PELVIS_M * motion.model.sizes.stature_m / _MODEL_STATURE_M
    pelvis = hips - rotations["pelvis"] @ offset
    columns |= {f"pelvis_t{axis}": values for axis, values in zip("xyz", pelvis.T, strict=True)}
    for side in ("right", "left"):
        for joint, names in _COORDINATES.items():
            if joint == "trunk" and side == "left":
                continue
            turns = _turns(rotations[joint if joint == "trunk" else f"{side}_{joint}"])
            sign = -1.0 if joint == "knee" else 1.0
            columns |= {
                name.format(side[0]): sign * values
                for name, values in zip(names, turns, strict=True)
                if name
            }
    return columns


def _turns(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns (3, T) degrees about z, x and y, each triple the one of all that mean the same which
    is nearest to the one before.
    """
    triples = euler_degrees(matrices, "ZXY")
    for row in range(1, len(triples)):
        a, b, c = triples[row]
        both = np.array([[a, b, c], [a + 180, 180 - b, c + 180]])
        both += 360 * np.round((triples[row - 1] - both) / 360)
        triples[row] = both[np.abs(both - triples[row - 1]).sum(axis=1).argmin()]
    return triples.T
