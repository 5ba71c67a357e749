"""The report's table of errors to be expected: of joints in mm, of angles in degrees."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.angle_errors import expected_angle_errors
from silhouette_core.motion.gait_values import SIDES
from silhouette_core.motion.motion import Motion

# Joint: its angle and the angle's words; empty where none is told.
_JOINTS = {
    "pelvis": ("", ""),
    "{}_hip": ("{}_hip_adduction", "hip adduction"),
    "{}_knee": ("{}_knee_flexion", "knee flexion"),
    "{}_ankle": ("{}_ankle_dorsiflexion", "ankle dorsiflexion"),
    "neck": ("", ""),
    "{}_shoulder": ("", ""),
    "{}_elbow": ("{}_elbow_flexion", "elbow flexion"),
    "{}_wrist": ("", ""),
}


class ErrorRow(NamedTuple):
    """Errors of a joint and of its angle, each of the left and the right side, or of the middle."""

    joint: str
    joint_mm: str
    angle: str
    angle_deg: str


def error_rows(motion: Motion) -> list[ErrorRow]:
    """A row for each joint, in the median frame; none where no errors are stated."""
    degrees = expected_angle_errors(motion)
    if not degrees:
        return []
    stated = np.asarray(motion.quality["joint_error_mm"], float)
    millimetres: dict[str, NDArray[np.float64]] = dict(zip(LANDMARK_NAMES, stated.T, strict=True))
    return [
        ErrorRow(
            name.removeprefix("{}_"),
            _words(name, millimetres, 0),
            words,
            _words(angle, degrees, 1) if angle else "",
        )
        for name, (angle, words) in _JOINTS.items()
    ]


def _words(name: str, errors: Mapping[str, NDArray[np.float64]], digits: int) -> str:
    names = [name.format(side) for side in SIDES] if "{}" in name else [name]
    return " / ".join(
        f"{np.nanmedian(errors[joint]):.{digits}f}" if np.isfinite(errors[joint]).any() else "–"
        for joint in names
    )
