"""Reader of Biovision hierarchy (BVH) files.

Libraries fall short: bvhio 1.5 does not end on a file with fewer rows than stated, and makes an
object for every joint and frame; pybvh 0.9 refuses joints with positions of their own, as written
by Blender and MotionBuilder.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from calib.storage.documents import load_text
from silhouette_core.body.rigs.bvh_hierarchy import LARGEST_CLIP, LARGEST_VALUE, BvhJoint, split_bvh


def read_bvh(path: Path) -> tuple[list[BvhJoint], FloatArray, float]:
    """Hierarchy, channels and frame rate of a file. Raises InputError where the file is missing,
    truncated, no BVH, has another number of frames than stated, or values that are no numbers.

    Returns:
        The joints, parents first, without end sites; the channels (T, C) float64 in the file's
        units; frames per second.
    """
    text = load_text(path, LARGEST_CLIP, errors="replace")
    joints, tail = split_bvh(text, path)
    stated = re.match(r"\s*Frames:\s*([0-9]{1,9})\s+Frame Time:\s*(\S+)", tail)
    if stated is None:
        raise InputError(f"{path} does not say 'Frames:' and 'Frame Time:' after MOTION")
    numbers = _numbers(path, tail[stated.end() :])
    count, columns = int(stated[1]), sum(len(joint.channels) for joint in joints)
    rows, rest = divmod(len(numbers), max(columns, 1))
    if rest:
        raise InputError(
            f"{path} ends in the middle of frame {rows}: it is cut off, or its channels are not"
            " those it lists"
        )
    if rows != count or not count:
        raise InputError(
            f"{path} says it has {count} frames, but holds {rows}: export it again, or set"
            " 'Frames:' right"
        )
    return joints, numbers.reshape(count, columns), _rate(path, stated[2])


def local_transforms(
    path: Path, joints: list[BvhJoint], numbers: FloatArray, selected: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Transforms of selected joints from their channels: parent_from_joint (T, W, 3, 3) and offsets
    (T, W, 3), float64.

    Rotations apply in the order listed, R = R_first R_second R_third, degrees. Positions replace
    the joint's offset (Blender, MotionBuilder); the root's are added to it. Raises InputError where
    a joint rotates twice in succession about one axis.

    Args:
        path: the file, for messages.
        numbers: (T, C) float64, all channels.
        selected: (W,) int64, indices of the joints.
    """
    local = np.broadcast_to(np.eye(3), (len(numbers), len(selected), 3, 3)).copy()
    offsets = np.tile(np.array([joints[j].offset for j in selected]), (len(numbers), 1, 1))
    first = np.cumsum([0] + [len(joint.channels) for joint in joints])
    for w, j in enumerate(selected):
        joint, values = joints[j], numbers[:, first[j] : first[j + 1]]
        turns = [k for k, (_, kind) in enumerate(joint.channels) if kind == "rotation"]
        if turns:
            order = "".join(joint.channels[k][0] for k in turns)
            try:
                local[:, w] = Rotation.from_euler(order, values[:, turns], degrees=True).as_matrix()
            except ValueError as error:
                raise InputError(
                    f"{path}: joint {joint.name[:60]} turns in the order {order}, which cannot be:"
                    f" {error}"
                ) from error
        for k, (axis, kind) in enumerate(joint.channels):
            if kind == "position":
                offsets[:, w, "XYZ".index(axis)] = values[:, k] + (
                    joint.offset["XYZ".index(axis)] if joint.parent < 0 else 0.0
                )
    return local, offsets


def _numbers(path: Path, text: str) -> FloatArray:
    try:
        parts = [np.array(line.split(), float) for line in text.splitlines()]
        numbers = np.concatenate([np.zeros(0), *parts])
    except ValueError as error:
        raise InputError(
            f"{path} has something in its frames that is no number: {str(error)[:100]}; mend it"
        ) from error
    check_numbers(path, numbers)
    return numbers


def check_numbers(path: Path, numbers: FloatArray) -> None:
    """Checks that the numbers of a file can be angles and positions. Raises InputError where one
    cannot.
    """
    if not np.isfinite(numbers).all():
        raise InputError(f"{path} has frames with NaN or infinity: leave them out")
    largest = np.abs(numbers).max(initial=0)
    if largest >= LARGEST_VALUE:
        raise InputError(
            f"{path} has frames with {largest:.3g}, which is no angle or position: leave them out"
        )


def _rate(path: Path, frame_time: str) -> float:
    try:
        seconds = float(frame_time)
    except ValueError:
        seconds = 0.0
    if not 1e-5 < seconds < 10:
        raise InputError(
            f"{path} says 'Frame Time: {frame_time[:40]}', which is no time between frames in s"
        )
    return 1.0 / seconds
