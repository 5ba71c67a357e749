"""Skeleton of a BVH file, its bones as capsules."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.checks import FloatArray
from calib.errors import InputError
from calib.storage.documents import load_text
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigid_parts import Capsule, body_of_parts
from silhouette_core.body.rigs.bvh_hierarchy import LARGEST_CLIP, BvhJoint, split_bvh
from silhouette_core.body.rigs.rig_checks import (
    check_bones,
    check_different,
    check_rest,
    parents_first,
    z_up,
)
from silhouette_core.body.rigs.rig_dofs import FREE_DEG, UNITS_M, RigTable, read_rig_table
from silhouette_core.tuning import MEASURING

_TURNS = {"X": (1, 0, 0), "Y": (0, 0, 1), "Z": (0, -1, 0)}  # y up to z up
_TABLE_AXES = {"X": ("x", 1), "Y": ("z", 1), "Z": ("y", -1)}


def read_bvh_rig(path: Path) -> BodyModel:
    """Body of a BVH skeleton.

    The rest pose has all channels at zero; y up and facing +z become z up and facing -y. Every
    joint but the root turns about the axes of its rotation channels, 150 degrees to either side or
    as NAME.rig.toml says; position channels are left out. Bones are capsules, as wide as that file
    says, or 0.12 of their length. The frames are left out. Landmarks are the joints, and the end
    sites as JOINT_end. Raises InputError where the file is damaged, its unit is not said, or it has
    a rig that none can have.

    Args:
        path: the file. BVH does not say its unit: NAME.rig.toml beside it has to.
    """
    table = read_rig_table(path)
    joints, _ = split_bvh(load_text(path, LARGEST_CLIP, errors="replace"), path)
    if table.unit is None:
        raise InputError(
            f'{path} does not say its unit of length: which is it? Write unit = "cm" (or'
            f" {', '.join(unit for unit in UNITS_M if unit != 'cm')}) into {path.stem}.rig.toml"
            " beside it"
        )
    unit_m, names = UNITS_M[table.unit], [joint.name for joint in joints]
    check_different(path, names)
    parents_first(path, {j.name: names[j.parent] if j.parent >= 0 else "" for j in joints})
    table.check_joints(path, names)
    tree = KinematicTree.from_parts(
        [
            (j.name, names[j.parent], _dofs(j, table)) if j.parent >= 0 else (j.name, "", ())
            for j in joints
        ],
        {f"{j.name}_end": j.name for j in joints if j.end is not None},
        root_fixed=table.root_fixed,
    )
    positions = _positions(joints, unit_m)
    ends = {
        number: positions[number] + unit_m * z_up(joint.end)
        for number, joint in enumerate(joints)
        if joint.end is not None
    }
    marks = np.array([*positions, *ends.values()])
    check_rest(path, positions, marks)
    check_bones(path, names, tree.parents, positions)
    shapes: list[list[Capsule]] = [[] for _ in joints]
    for number, joint in enumerate(joints):
        if joint.parent >= 0:
            shapes[joint.parent].append(
                _capsule(positions[joint.parent], positions[number], table.radius)
            )
        if number in ends and np.any(ends[number] != positions[number]):
            shapes[number].append(_capsule(positions[number], ends[number], table.radius))
    if not any(shapes):
        raise InputError(f"{path} has no bone: a skeleton needs two joints or an end site")
    return body_of_parts(tree, positions, shapes, marks)


def _dofs(joint: BvhJoint, table: RigTable) -> tuple[Dof, ...]:
    """Turns of a joint about the axes of its rotation channels, each once."""
    given = table.limits.get(joint.name, {})
    dofs = []
    for axis in dict.fromkeys(axis for axis, kind in joint.channels if kind == "rotation"):
        name, sign = _TABLE_AXES[axis]
        dof = Dof(f"{axis}rotation", _TURNS[axis], (-FREE_DEG, FREE_DEG))
        if name in given:
            low, high = sorted(sign * limit for limit in given[name])
            dof = replace(dof, limits_deg=(low, high))
        dofs.append(dof)
    return tuple(dofs)


def _positions(joints: list[BvhJoint], unit_m: float) -> FloatArray:
    """Positions (P, 3) at rest, the root where its offset says."""
    positions = np.zeros((len(joints), 3))
    for number, joint in enumerate(joints):
        above = positions[joint.parent] if joint.parent >= 0 else 0.0
        positions[number] = above + unit_m * z_up(joint.offset)
    return positions


def _capsule(start: FloatArray, end: FloatArray, radius_m: float | None) -> Capsule:
    length = float(np.linalg.norm(end - start))
    first, last = tuple(start.tolist()), tuple(end.tolist())
    return Capsule(first, last, MEASURING.bone_radius * length if radius_m is None else radius_m)
