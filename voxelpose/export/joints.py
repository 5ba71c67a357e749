"""joints.csv: the 15 joints of the HumanEva protocol, one row per frame and joint."""

from pathlib import Path

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.motion import Motion

COLUMNS = ("frame", "time_s", "joint", "x_m", "y_m", "z_m", "confidence")


def write_joints(motion: Motion, path: Path) -> None:
    """Writes joint positions in world coordinates (axes of the calibration), metres.

    Args:
        motion: T poses; frames that are lost have no rows.
        path: the CSV file.
    """
    positions, confidence = motion.landmarks(), motion.landmark_confidence()
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(COLUMNS) + "\n")
        for row, frame in enumerate(motion.frames):
            for joint, name in enumerate(LANDMARK_NAMES):
                x, y, z = positions[row, joint]
                file.write(
                    f"{frame},{motion.time_s[row]:.6f},{name},{x:.6f},{y:.6f},{z:.6f},{confidence[row, joint]:.3f}\n"
                )
