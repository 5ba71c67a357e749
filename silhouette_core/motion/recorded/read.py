"""A motion file in, whatever its format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calib.errors import InputError
from silhouette_core.motion.recorded.bvh import local_transforms, read_bvh
from silhouette_core.motion.recorded.expmap import read_expmap
from silhouette_core.motion.recorded.names import find_roles
from silhouette_core.motion.recorded.skeleton import RecordedMotion, place_joints

SUFFIXES = (".bvh", ".csv")


def read_recorded(path: Path, names: Path | None = None, fps: float | None = None) -> RecordedMotion:
    """Reads recorded motion.

    Args:
        path: a BVH of any skeleton, or a CSV of exponential maps with skeleton.json beside it.
        names: a joint-name map in TOML; None takes the shipped map (CMU, CC_Base, Mixamo, plain) that covers the skeleton.
        fps: frames per second, where the file states them wrongly; None believes the file.

    Returns:
        The take in the file's own unit and axes, its joints named.

    Raises:
        InputError: the file cannot be read, contradicts itself, or has joints without a known name.
    """
    if path.suffix.lower() == ".bvh":
        joints, numbers, rate = read_bvh(path)
        labels, parents = tuple(joint.name for joint in joints), np.array([joint.parent for joint in joints], np.int64)
        roles = find_roles(path.name, labels, names)
        offsets = np.array([joint.offset for joint in joints], float)
        local, places = local_transforms(path, joints, numbers)
    elif path.suffix.lower() == ".csv":
        labels, parents, places, local, rate = read_expmap(path)
        roles = find_roles(path.name, labels, names)
        offsets = places[0]
    else:
        raise InputError(f"{path} is no motion that is read here: give .bvh, or .csv with skeleton.json beside it")
    if fps is not None and fps <= 0:
        raise InputError(f"{fps} frames per second cannot be")
    rotations, positions = place_joints(parents, places, local)
    return RecordedMotion(path.name, fps or rate, labels, parents, offsets, rotations, positions, roles)
