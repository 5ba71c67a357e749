"""MakeHuman's rig "cmu_mb" and the human tree: which bone is which part, and their rest poses.

MakeHuman stands with bent elbows, the human tree with straight arms 45 degrees below the
horizontal. A bone's turn brings it from the first rest pose into the second.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import Dof

_TRUNK = {
    "Hips": "pelvis",
    "LHipJoint": "pelvis",
    "RHipJoint": "pelvis",
    "LowerBack": "lumbar",
    "Spine": "thorax",
    "Spine1": "upper_thorax",
    "Neck": "neck",
    "Neck1": "neck",
    "Head": "head",
}
_LIMBS = {
    "Shoulder": "clavicle",
    "Arm": "upper_arm",
    "ForeArm": "forearm",
    "Hand": "hand",
    "FingerBase": "hand",
    "HandFinger1": "fingers",
    "UpLeg": "thigh",
    "Leg": "shin",
    "Foot": "foot",
    "ToeBase": "toes",
}
PART_OF_BONE = (
    _TRUNK
    | {
        side + bone: f"{side.lower()}_{p}"
        for side in ("Left", "Right")
        for bone, p in _LIMBS.items()
    }
    | {"LThumb": "left_thumb", "RThumb": "right_thumb"}
)
"""Bone of the rig -> part of the human tree. A part's joint is the head of its first bone."""
_ARM_PARTS = ("upper_arm", "forearm", "hand", "thumb", "fingers")


def turns_to_human_rest(heads_m: Mapping[str, NDArray]) -> dict[str, NDArray[np.float64]]:
    """Rotation (3, 3) of every bone with a head (3,), m, from MakeHuman's rest pose to the human
    tree's.
    """
    turns = {bone: np.eye(3) for bone in PART_OF_BONE}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        along = np.array([sign, 0.0, -1.0]) / np.sqrt(2)
        hinge = np.array([-1.0, 0.0, -sign]) / np.sqrt(2)  # of the elbow's flexion
        shoulder, elbow, wrist = (heads_m[side + bone] for bone in ("Arm", "ForeArm", "Hand"))
        bent = np.cross(elbow - shoulder, wrist - elbow)
        # A straight arm shows no hinge: the human tree's own serves.
        if np.linalg.norm(bent) < 0.05 * np.linalg.norm(elbow - shoulder) ** 2:
            bent = hinge
        target = _frame(along, hinge)
        upper = target @ _frame(elbow - shoulder, bent).T
        lower = target @ _frame(wrist - elbow, bent).T
        turns[side + "Arm"] = upper
        for bone in ("ForeArm", "Hand", "FingerBase", "HandFinger1"):
            turns[side + bone] = lower
        turns[side[0] + "Thumb"] = lower
    return turns


def native_dofs(
    bone: str, parent: str, turns: Mapping[str, NDArray[np.float64]]
) -> tuple[Dof, ...]:
    """Degrees of freedom of a bone in MakeHuman's rest pose: those of its part in the human tree,
    their axes and limits seen from that pose. A bone that continues its part has none.

    Args:
        turns: as `turns_to_human_rest` gives them.
    """
    part = PART_OF_BONE.get(bone)
    if part is None or part == PART_OF_BONE.get(parent):
        return ()
    own = [dof for number, dof in HUMAN.dofs if HUMAN.names[number] == part]
    # A rotation R from the human rest pose is turns[parent]ᵀ R turns[bone] from MakeHuman's.
    offset = Rotation.from_matrix(turns[parent].T @ turns[bone]).as_rotvec(degrees=True)
    result = []
    for dof in own:
        axis = turns[bone].T @ np.array(dof.axis)
        shift = float(axis @ offset)
        low, high = dof.limits_deg
        x, y, z = axis.tolist()
        result.append(replace(dof, axis=(x, y, z), limits_deg=(low + shift, high + shift)))
    return tuple(result)


def human_rest(
    names: Sequence[str],
    heads_m: NDArray[np.float64],
    vertices_m: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Joints (27, 3) and vertices (V, 3), m, and skin weights (V, 27), of a body of this rig in the
    rest pose of the human tree.

    Args:
        names: B bones, every one after its parent.
        heads_m: (B, 3).
        vertices_m: (V, 3).
        weights: (V, B) skin weights.
    """
    heads = dict(zip(names, heads_m, strict=True))
    turns = turns_to_human_rest(heads)
    moved = dict(heads)
    for side in ("Left", "Right"):
        chain = [side + bone for bone in ("Arm", "ForeArm", "Hand", "FingerBase", "HandFinger1")]
        for parent, bone in [*pairwise(chain), (chain[2], side[0] + "Thumb")]:
            moved[bone] = moved[parent] + turns[parent] @ (heads[bone] - heads[parent])
    turn = np.array([turns.get(name, np.eye(3)) for name in names])
    shift = np.array([moved[n] for n in names]) - np.einsum("bij,bj->bi", turn, heads_m)
    vertices = np.einsum("vb,bij,vj->vi", weights, turn, vertices_m) + weights @ shift
    joints = np.zeros((len(HUMAN.names), 3))
    table = np.zeros((len(names), len(HUMAN.names)))
    for bone in reversed(PART_OF_BONE):
        joints[HUMAN.names.index(PART_OF_BONE[bone])] = moved[bone]
    for number, name in enumerate(names):
        table[number, HUMAN.names.index(PART_OF_BONE.get(name, "pelvis"))] = 1.0
    return _with_abdomen(joints, vertices, weights @ table)


def _with_abdomen(
    joints: NDArray[np.float64], vertices: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The rig has one bone where the tree has two parts: the upper half is the abdomen's."""
    lumbar, abdomen, thorax = (HUMAN.names.index(n) for n in ("lumbar", "abdomen", "thorax"))
    joints[abdomen] = (joints[lumbar] + joints[thorax]) / 2
    half = (joints[thorax, 2] - joints[lumbar, 2]) / 4
    share = np.clip((vertices[:, 2] - joints[abdomen, 2]) / (2 * half) + 0.5, 0, 1)
    weights[:, abdomen] = weights[:, lumbar] * share
    weights[:, lumbar] *= 1 - share
    return joints, vertices, weights


def _frame(along: NDArray[np.float64], hinge: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) whose first column points along, its second along the hinge."""
    first = along / np.linalg.norm(along)
    second = hinge - (hinge @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)
