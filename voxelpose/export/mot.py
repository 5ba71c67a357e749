"""MOT: joint coordinates for OpenSim.

Axis map: x = y, y = z, z = x of the world (y up), metres, as in Pose2Sim: files of both programs
made with one calibration coincide. A person who faces the world's +y faces OpenSim's +x, as
OpenSim's models do.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import LAB_FROM_WORLD, euler_degrees, joint_rotations
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.motion import Motion

_HIPS = [LANDMARK_NAMES.index("left_hip"), LANDMARK_NAMES.index("right_hip")]

# Coordinates of every joint in Rajagopal et al.'s model: rotations about z, x and y, {} being r or
# l; None where the model has no such coordinate.
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
    """Writes joint coordinates, of at least one pose, with the names and signs of Rajagopal et
    al.'s full-body model.

    Angles are in degrees and continuous in time; `pelvis_tx`, `_ty`, `_tz` are in metres with the
    axis map above, for the model's pelvis scaled by stature. The order of rotations is the model's:
    pelvis tilt, list, rotation; flexion, adduction, rotation of hip and arm. Degrees of freedom
    that the model lacks are left out: adduction and rotation of the knee, the neck, the shoulder
    girdle. Models of the gait2392 family count knee flexion negative and have no arms.

    Frames without a pose have no row; OpenSim interpolates between rows by their times. A line of
    the head states filter and filling of gaps.
    """
    columns = mot_coordinates(motion)
    # Adding 0.0 turns -0.0 into 0.0.
    table = np.column_stack([motion.frames / motion.fps, *columns.values()]).round(6) + 0.0
    head = [
        "Coordinates",
        "version=1",
        f"nRows={len(table)}",
        f"nColumns={table.shape[1]}",
        "inDegrees=yes",
        "",
        conditioning_words(motion),
        "",
        "endheader",
    ]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(head) + "\n" + "\t".join(["time", *columns]) + "\n")
        file.writelines("\t".join(f"{value:.6f}" for value in row) + "\n" for row in table)


def mot_coordinates(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """Returns the coordinates of a MOT file by name, (T,) float64 each, degrees and metres."""
    stature_m = motion.model.sizes.stature_m  # refuses a body that is no person's
    motion = motion.upright()
    rotations = joint_rotations(motion)
    names = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
    columns = dict(zip(names, _rotation_angles(rotations["pelvis"]), strict=True))
    hips = motion.landmarks()[:, _HIPS].mean(axis=1) @ LAB_FROM_WORLD.T
    # Midpoint of the hips in the pelvis frame of Rajagopal's model, of a person 1.70 m tall.
    hips_in_pelvis_m = np.array([-0.056276, -0.07849, 0.0])
    offset = hips_in_pelvis_m * stature_m / 1.70
    pelvis = hips - rotations["pelvis"] @ offset
    columns |= {f"pelvis_t{axis}": values for axis, values in zip("xyz", pelvis.T, strict=True)}
    for side in ("right", "left"):
        for joint, names in _COORDINATES.items():
            if joint == "trunk" and side == "left":
                continue
            angles = _rotation_angles(rotations[joint if joint == "trunk" else f"{side}_{joint}"])
            sign = -1.0 if joint == "knee" else 1.0
            columns |= {
                name.format(side[0]): sign * values
                for name, values in zip(names, angles, strict=True)
                if name
            }
    return columns


def _rotation_angles(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation angles (3, T) about z, x and y, degrees, of matrices (T, 3, 3), that are continuous
    in time: of the equivalent triples, each is the nearest to its predecessor.
    """
    angles = euler_degrees(matrices, "ZXY")
    for row in range(1, len(angles)):
        z, x, y = angles[row]
        equivalent = np.array([[z, x, y], [z + 180, 180 - x, y + 180]])
        equivalent += 360 * np.round((angles[row - 1] - equivalent) / 360)
        angles[row] = equivalent[np.abs(equivalent - angles[row - 1]).sum(axis=1).argmin()]
    return angles.T
