"""The 15 joints of a recording's truth, and how other keypoint sets are mapped to them.

The names are those of the HumanEva protocol. pelvis, neck and head_top mean different places in
different data sets; every card says which, and `Take.approximate` names what had to be constructed.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from take import InputError, read_text

FloatArray = NDArray[np.float64]

JOINTS = tuple(
    "pelvis left_hip left_knee left_ankle right_hip right_knee right_ankle neck head_top "
    "left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist".split()
)

# Height of the top of the head over the ear hole of an adult, m: about the mean of ANSUR's
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


def picked(points: ArrayLike, places: Mapping[str, int]) -> FloatArray:
    """Returns (T, 15, 3) float64 joints out of (T, N, 3) points, by each joint's place in N."""
    return np.asarray(points, dtype=np.float64)[:, [places[joint] for joint in JOINTS]]


def from_keypoints(
    points: ArrayLike, places: Mapping[str, int]
) -> tuple[FloatArray, tuple[str, ...]]:
    """Makes the 15 joints of the keypoints of a 2-D detector, which have no top of the head.

    A pelvis or neck that is missing is put between the hips or shoulders. The top of the head is
    put 13 cm beyond the middle of the ears, seen from the neck.

    Args:
        points: (T, N, 3), m; NaN where unknown.
        places: place in N of the limbs' joints, `left_ear`, `right_ear`, perhaps `pelvis`, `neck`.

    Returns:
        (T, 15, 3) float64, m, and the joints that were constructed.
    """
    table = np.asarray(points, dtype=np.float64)
    found = {name: table[:, place] for name, place in places.items()}
    constructed = []
    for middle, ends in (("pelvis", "hip"), ("neck", "shoulder")):
        if middle not in found:
            found[middle] = (found[f"left_{ends}"] + found[f"right_{ends}"]) / 2
            constructed.append(middle)
    ears = (found["left_ear"] + found["right_ear"]) / 2
    found["head_top"] = beyond(found["neck"], ears, _VERTEX_OVER_EARS_M)
    return np.stack([found[joint] for joint in JOINTS], axis=1), (*constructed, "head_top")


def beyond(start: FloatArray, end: FloatArray, distance_m: float) -> FloatArray:
    """Returns the points, (T, 3), on the lines from `start` on that lie so far beyond `end`."""
    way = end - start
    with np.errstate(invalid="ignore", divide="ignore"):
        return end + distance_m * way / np.linalg.norm(way, axis=-1, keepdims=True)


def confident(points: ArrayLike, least: float) -> FloatArray:
    """Returns (..., 3) of (..., 4) points whose confidence exceeds `least`; NaN for the others."""
    table = np.asarray(points, dtype=np.float64)
    return np.where(table[..., 3:] > least, table[..., :3], np.nan)


def fitted(truth: FloatArray, first: int, count: int) -> FloatArray:
    """Returns frames `first` to `first + count`, NaN where the truth does not reach."""
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


def read_json(file: Path) -> object:
    """Returns a JSON file's content.

    Raises:
        InputError: it is missing or no JSON.
    """
    try:
        return json.loads(read_text(file))
    except json.JSONDecodeError as error:
        raise InputError(f"{file} is not whole JSON ({error}): download it again") from None
