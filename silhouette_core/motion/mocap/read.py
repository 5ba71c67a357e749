"""A motion file in, whatever its format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.motion.mocap.bvh import local_transforms, read_bvh
from silhouette_core.motion.mocap.expmap import read_expmap
from silhouette_core.motion.mocap.names import find_roles
from silhouette_core.motion.mocap.skeleton import MocapClip, place_joints

SUFFIXES = (".bvh", ".csv")


def read_clip(path: Path, names: Path | None = None, fps: float | None = None) -> MocapClip:
    """Reads recorded motion.

    Args: path: a BVH of any skeleton, or a CSV of exponential maps with skeleton.json beside it.
        names: a joint-name map in TOML; None takes the shipped map (CMU, CC_Base, Mixamo, plain)
        that covers the skeleton. fps: frames per second, where the file states them wrongly; None
        believes the file.

    Returns: The take in the file's own unit and axes: the joints that have a role, and those that
        carry them.

    Raises:
        InputError: the file cannot be read, contradicts itself, or has joints without a known name.
    """
    if fps is not None and fps <= 0:
        raise InputError(f"{fps} frames per second cannot be")
    if path.suffix.lower() == ".bvh":
        hierarchy, numbers, rate = read_bvh(path)
        joints, parents = (
            tuple(joint.name for joint in hierarchy),
            np.array([joint.parent for joint in hierarchy], np.int64),
        )
        roles = find_roles(path.name, joints, names)
        wanted = _with_ancestors(roles, parents)
        local, places = local_transforms(path, hierarchy, numbers, wanted)
        offsets = np.array([hierarchy[joint].offset for joint in wanted])
    elif path.suffix.lower() == ".csv":
        joints, parents, places, local, rate = read_expmap(path)
        roles = find_roles(path.name, joints, names)
        wanted = _with_ancestors(roles, parents)
        local, places = local[:, wanted], places[:, wanted]
        offsets = places[0]
    else:
        raise InputError(
            f"{path} is no motion that is read here: give .bvh, or .csv with skeleton.json"
            " beside it"
        )
    new = {-1: -1} | {int(joint): index for index, joint in enumerate(wanted)}
    parents = np.array([new[parent] for parent in parents[wanted].tolist()], np.int64)
    rotations, positions = place_joints(parents, places, local)
    names_left, roles_left = (
        tuple(joints[joint] for joint in wanted),
        {role: new[joint] for role, joint in roles.items()},
    )
    return MocapClip(
        path.name, fps or rate, names_left, parents, offsets, rotations, positions, roles_left
    )


def _with_ancestors(roles: dict[str, int], parents: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the named joints and those that carry them, in the file's order: fingers and faces
    need not be placed.
    """
    wanted: set[int] = set()
    for role in roles.values():
        joint = role
        while joint >= 0 and joint not in wanted:
            wanted.add(joint)
            joint = int(parents[joint])
    return np.array(sorted(wanted), np.int64)
