"""The 15 joints of a recording's truth, and the mapping of other keypoint sets to them.

The names are those of the HumanEva protocol. pelvis, neck and head_top are at different places in
different data sets; every card says where, and `Clip.approximate` names the constructed joints.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from clip import InputError
from numpy.typing import ArrayLike, NDArray

from silhouette_core.body.joints import LANDMARK_NAMES as JOINTS

FloatArray = NDArray[np.float64]


# Height of the top of the head above the ear hole of an adult, m: about the mean of ANSUR's
# tragion-to-vertex height of women and men.
_VERTEX_OVER_EARS_M = 0.13

_SIDES = "shoulder elbow wrist hip knee ankle".split()
COCO17 = {"left_ear": 3, "right_ear": 4} | {
    f"{side}_{joint}": 5 + 2 * number + offset
    for number, joint in enumerate(_SIDES)
    for offset, side in enumerate(("left", "right"))
}
BODY25 = {"neck": 1, "pelvis": 8, "right_ear": 17, "left_ear": 18} | {
    f"{side}_{joint}": first + number
    for side, arm, leg in (("right", 2, 9), ("left", 5, 12))
    for first, joints in ((arm, _SIDES[:3]), (leg, _SIDES[3:]))
    for number, joint in enumerate(joints)
}


def select_joints(points: ArrayLike, places: Mapping[str, int]) -> FloatArray:
    """Returns (T, 15, 3) float64 joints out of (T, N, 3) points, by each joint's place in N."""
    return np.asarray(points, dtype=np.float64)[:, [places[joint] for joint in JOINTS]]


def from_keypoints(
    points: ArrayLike, places: Mapping[str, int]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Returns the 15 joints from the keypoints of a 2-D detector, which have no top of the head.

    A missing pelvis or neck is placed midway between the hips or shoulders. The top of the head is
    placed 13 cm beyond the midpoint of the ears, on the line from the neck.

    Args:
        points: (T, N, 3), m; NaN where unknown.
        places: place in N of the limbs' joints, `left_ear`, `right_ear`, perhaps `pelvis`, `neck`.

    Returns:
        (T, 15, 3) float64, m, and the joints that were constructed.
    """
    table = np.asarray(points, dtype=np.float64)
    points_of = {name: table[:, place] for name, place in places.items()}
    constructed = []
    for middle, ends in (("pelvis", "hip"), ("neck", "shoulder")):
        if middle not in points_of:
            points_of[middle] = (points_of[f"left_{ends}"] + points_of[f"right_{ends}"]) / 2
            constructed.append(middle)
    ears = (points_of["left_ear"] + points_of["right_ear"]) / 2
    points_of["head_top"] = extend_line(points_of["neck"], ears, _VERTEX_OVER_EARS_M)
    return np.stack([points_of[joint] for joint in JOINTS], axis=1), (*constructed, "head_top")


def extend_line(start: FloatArray, end: FloatArray, distance_m: float) -> FloatArray:
    """Returns the points, (T, 3), a distance beyond `end` on the lines from `start` to `end`."""
    direction = end - start
    with np.errstate(invalid="ignore", divide="ignore"):
        return end + distance_m * direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def drop_uncertain(points: ArrayLike, threshold: float) -> FloatArray:
    """Returns (..., 3) of (..., 4) points with confidence above `threshold`; NaN for the others."""
    table = np.asarray(points, dtype=np.float64)
    return np.where(table[..., 3:] > threshold, table[..., :3], np.nan)


def crop_truth(truth: FloatArray, first: int, count: int) -> FloatArray:
    """Returns frames `first` to `first + count`, NaN where the truth has none."""
    result = np.full((count, len(JOINTS), 3), np.nan)
    part = truth[first : first + count]
    result[: len(part)] = part
    return result


def write_truth(
    file: Path, truth: FloatArray, fps: float, approximate: Sequence[str], data_set: str
) -> None:
    """Writes truth.json; unknown positions are null.

    Args:
        file: to write.
        truth: (T, 15, 3), m, z up.
        fps: frames per second.
        approximate: joints that were constructed.
        data_set: its name.

    Raises:
        InputError: no frame has all joints.
    """
    if not np.isfinite(truth).all(axis=(1, 2)).any():
        raise InputError(
            "the truth has no frame with all 15 joints in the frames chosen: choose others "
            "(--frames), or leave it out (--no-truth)"
        )
    joints = {
        name: [
            [round(value, 6) for value in point] if np.isfinite(point).all() else [None] * 3
            for point in truth[:, place].tolist()
        ]
        for place, name in enumerate(JOINTS)
    }
    document = {"fps": fps, "unit": "m", "up": "z", "data_set": data_set}
    document |= {"approximate": list(approximate), "joints": joints}
    file.write_text(json.dumps(document), encoding="utf-8")
