"""Motions of the body model from files and folders of recorded motion."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from calib.checks import IntArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.mocap.bvh import local_transforms, read_bvh
from silhouette_core.motion.mocap.expmap import read_expmap
from silhouette_core.motion.mocap.names import find_roles
from silhouette_core.motion.mocap.retarget import JointFrames, find_joint_frames, retarget
from silhouette_core.motion.mocap.skeleton import MocapClip, place_joints
from silhouette_core.motion.motion import Motion

SUFFIXES = (".bvh", ".csv")


def motion_files(paths: Iterable[Path]) -> list[Path]:
    """Motion files among files and folders, each once, those of a folder sorted by name.

    Folders are searched recursively; CSV files in them need skeleton.json. Raises InputError where
    a path does not exist, or a folder holds no motion.
    """
    files: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if _is_motion(file))
            if not inside:
                raise InputError(f"{path} holds no motion: no .bvh, and no .csv with skeleton.json")
            files.update(dict.fromkeys(inside))
        elif path.is_file():
            files[path] = None
        else:
            raise InputError(f"{path} does not exist")
    return list(files)


def _is_motion(file: Path) -> bool:
    return (
        file.suffix.lower() in SUFFIXES
        and not file.name.startswith(".")
        and (file.suffix.lower() != ".csv" or file.with_name("skeleton.json").exists())
    )


def load_motions(
    paths: Sequence[Path], model: BodyModel, names: Path | None = None
) -> list[Motion]:
    """Recorded motions, one for each of `motion_files(paths)`, retargeted to a body; clips of one
    skeleton share the axes of its trunk.

    Recordings faster than `FPS` are reduced to it by taking the nearest frames. Raises InputError
    as `read_clip`.

    Args:
        names: joint-name map for all files; None chooses a shipped one for each.
    """
    clips = [read_clip(path, names).at_rate(FPS) for path in motion_files(paths)]
    best: dict[tuple, JointFrames] = {}
    for clip in clips:
        reference = find_joint_frames(clip)
        if clip.skeleton not in best or reference.doubt_deg < best[clip.skeleton].doubt_deg:
            best[clip.skeleton] = reference
    return [retarget(clip, model, best[clip.skeleton]) for clip in clips]


def read_clip(path: Path, names: Path | None = None) -> MocapClip:
    """Recorded motion of a file. Raises InputError where the file cannot be read, contradicts
    itself, or has joints without a known name.

    Args:
        path: a BVH file of any skeleton, or a CSV of exponential maps with skeleton.json beside it.
        names: joint-name map in TOML; None: the shipped map (CMU, CC_Base, Mixamo, plain) that
            covers the skeleton.

    Returns:
        The clip in the file's unit and axes: the joints that have a role, and their ancestors.
    """
    if path.suffix.lower() == ".bvh":
        hierarchy, numbers, rate = read_bvh(path)
        joints = tuple(joint.name for joint in hierarchy)
        parents = np.array([joint.parent for joint in hierarchy], np.int64)
        roles = find_roles(path.name, joints, names)
        selected = _with_ancestors(roles, parents)
        local, positions_in_parent = local_transforms(path, hierarchy, numbers, selected)
        offsets = np.array([hierarchy[joint].offset for joint in selected])
    elif path.suffix.lower() == ".csv":
        joints, parents, positions_in_parent, local, rate = read_expmap(path)
        roles = find_roles(path.name, joints, names)
        selected = _with_ancestors(roles, parents)
        local, positions_in_parent = local[:, selected], positions_in_parent[:, selected]
        offsets = positions_in_parent[0]
    elif path.suffix.lower() == ".fbx":
        raise InputError(
            f"{path} is no motion that is read here: turn FBX into BVH in Blender"
            " (docs/exports.md#fbx-through-blender)"
        )
    else:
        raise InputError(
            f"{path} is no motion that is read here: give .bvh, or .csv with skeleton.json"
            " beside it"
        )
    new = {-1: -1} | {int(joint): index for index, joint in enumerate(selected)}
    parents = np.array([new[parent] for parent in parents[selected].tolist()], np.int64)
    rotations, positions = place_joints(parents, positions_in_parent, local)
    joint_names = tuple(joints[joint] for joint in selected)
    roles = {role: new[joint] for role, joint in roles.items()}
    return MocapClip(path.name, rate, joint_names, parents, offsets, rotations, positions, roles)


def _with_ancestors(roles: dict[str, int], parents: IntArray) -> IntArray:
    """Indices of the joints with a role and of their ancestors, in the file's order."""
    selected: set[int] = set()
    for role in roles.values():
        joint = role
        while joint >= 0 and joint not in selected:
            selected.add(joint)
            joint = int(parents[joint])
    return np.array(sorted(selected), np.int64)
