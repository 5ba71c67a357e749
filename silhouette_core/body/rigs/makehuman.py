"""Bodies of MakeHuman's data folder, on a rig of its own or on this project's human tree.

MakeHuman stands with bent elbows, the human tree with straight arms 45 degrees below the
horizontal: a turn of each bone of the rig "cmu_mb" brings it from the first rest pose into the
second.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from silhouette_core.body.joints import HUMAN, LANDMARK_BONES, LANDMARK_NAMES
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.makehuman_files import (
    BaseMesh,
    place_of,
    read_base_mesh,
    read_bone_weights,
    read_bones,
    read_target,
)
from silhouette_core.body.rigs.rig_checks import (
    check_rest,
    normalised_weights,
    parents_first,
    short,
    skinned_body,
)
from silhouette_core.body.rigs.rig_dofs import ball_joint

CMU = "cmu_mb"
ORIGINS = ("african", "asian", "caucasian")
_FREE_DEG = 120
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


@dataclass(frozen=True)
class MakeHumanPerson:
    """What MakeHuman makes a body from. Raises InputError for what MakeHuman does not make."""

    sex: str = "male"  #: "male" or "female".
    height: float = 0.0  #: -1 (smallest) to 1 (tallest); 0 is the average of the sex.
    weight: float = 0.0  #: -1 (lightest) to 1 (heaviest).
    muscle: float = 0.0  #: -1 (least) to 1 (most).
    origin: str = "caucasian"  #: "african", "asian" or "caucasian".

    def __post_init__(self) -> None:
        if self.sex not in ("male", "female"):
            raise InputError(f"MakeHuman has no sex {short(self.sex)}: give male or female")
        if self.origin not in ORIGINS:
            raise InputError(
                f"MakeHuman has no origin {short(self.origin)}: give {', '.join(ORIGINS)}"
            )
        for name in ("height", "weight", "muscle"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not -1 <= value <= 1:
                raise InputError(
                    f"MakeHuman's {name} {short(value)} is not from -1 to 1: 0 is average"
                )


def read_makehuman(
    folder: Path, person: MakeHumanPerson | None = None, rig: str = CMU, human: bool = False
) -> BodyModel:
    """Body of a MakeHuman data folder, standing on the ground. Raises InputError where a file is
    missing or damaged, or there is no such body.

    Args:
        person: the body's shape; None: an average man.
        rig: name of the rig in rigs/standard, whose bones become the parts.
        human: whether the body goes onto this project's human tree instead (only from the rig
            "cmu_mb"): its 27 parts, names, limits and rest pose, to which the arms are turned.

    Returns:
        The body. On the rig "cmu_mb", and on the human tree, its landmarks are the 15 of
        `joints.LANDMARK_NAMES`, else every bone's head.
    """
    if human and rig != CMU:
        raise InputError(f"only MakeHuman's rig {CMU!r} fits the human tree, not {rig!r}")
    mesh = read_base_mesh(folder)
    vertices = _shaped(folder, mesh, person or MakeHumanPerson())
    bones = read_bones(folder, rig)
    path = folder / "rigs" / "standard" / f"rig.{rig}.json"
    names = parents_first(path, {name: parent for name, (parent, _) in bones.items()})
    heads = np.array([place_of(path, n, bones[n][1], mesh, vertices) for n in names])
    weights = read_bone_weights(folder, rig, names, len(vertices))
    used, faces = np.unique(mesh.faces, return_inverse=True)
    numbers = np.broadcast_to(np.arange(len(names)), (len(used), len(names)))
    weights = normalised_weights(
        path.with_name(f"weights.{rig}.json"), numbers, weights[used], len(names)
    )
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    check_rest(path, heads, vertices)
    ground = np.array([0.0, 0.0, vertices[:, 2].min()])
    skin = _Skin(names, heads - ground, vertices - ground, faces, weights)
    parents = np.array([names.index(p) if (p := bones[n][0]) else -1 for n in names], np.int32)
    if rig != CMU:
        turns = ball_joint(_FREE_DEG)
        tree = KinematicTree.from_parts(
            [(name, bones[name][0], turns if bones[name][0] else ()) for name in names]
        )
        return skin.body(tree, skin.heads_m)
    if missing := [bone for bone in PART_OF_BONE if bone not in names]:
        raise InputError(f"{path} lacks the bone {missing[0]!r}: give MakeHuman's own rig")
    return skin.on_human_tree() if human else skin.on_cmu_tree(parents)


@dataclass(frozen=True, eq=False)
class _Skin:
    """A shaped mesh and the bones that move it, standing on the ground."""

    names: list[str]
    heads_m: FloatArray
    vertices_m: FloatArray
    faces: IntArray
    weights: FloatArray

    def body(self, tree: KinematicTree, landmarks_m: FloatArray) -> BodyModel:
        """The body on a tree whose parts are these bones."""
        every = np.broadcast_to(np.arange(self.weights.shape[1]), self.weights.shape)
        return skinned_body(
            tree, self.heads_m, self.vertices_m, self.faces, every, self.weights, landmarks_m
        )

    def on_cmu_tree(self, parents: NDArray[np.int32]) -> BodyModel:
        """The body on the CMU rig itself, in MakeHuman's own rest pose."""
        heads = dict(zip(self.names, self.heads_m, strict=True))
        turns = turns_to_human_rest(heads)
        dofs: list[tuple[int, Dof]] = []
        for part, (name, parent) in enumerate(zip(self.names, parents, strict=True)):
            if parent >= 0:
                dofs += [(part, d) for d in native_dofs(name, self.names[parent], turns)]
        bones = {PART_OF_BONE[bone]: bone for bone in reversed(PART_OF_BONE)}
        carriers = [
            self.names.index(bones[HUMAN.names[part]]) for part in HUMAN.landmark_part.tolist()
        ]
        tree = KinematicTree(
            tuple(self.names),
            parents,
            tuple(dofs),
            LANDMARK_NAMES,
            np.array(carriers, np.int32),
            LANDMARK_BONES,
        )
        return self.body(tree, self._landmarks(self.heads_m[carriers]))

    def on_human_tree(self) -> BodyModel:
        """The body on the human tree, turned to its rest pose."""
        joints, vertices, weights = human_rest(
            self.names, self.heads_m, self.vertices_m, self.weights
        )
        ground = np.array([0.0, 0.0, vertices[:, 2].min()])
        skin = _Skin(list(HUMAN.names), joints - ground, vertices - ground, self.faces, weights)
        return skin.body(HUMAN, skin._landmarks(skin.heads_m[HUMAN.landmark_part]))

    def _landmarks(self, joints_m: FloatArray) -> FloatArray:
        """Landmarks (15, 3): the joints of their parts, and the highest vertex."""
        marks = joints_m.copy()
        marks[LANDMARK_NAMES.index("head_top")] = self.vertices_m[self.vertices_m[:, 2].argmax()]
        return marks


def _shaped(folder: Path, mesh: BaseMesh, person: MakeHumanPerson) -> FloatArray:
    """Vertices (N, 3) of the base mesh after the targets of a young adult of that shape."""
    count = len(mesh.vertices_m)
    average = "averagemuscle-averageweight"
    shaped = mesh.vertices_m + read_target(folder, f"{person.origin}-{person.sex}-young", count)
    muscle, weight = abs(person.muscle), abs(person.weight)
    for muscles, share in (
        (_level(person.muscle, "muscle"), muscle),
        ("averagemuscle", 1 - muscle),
    ):
        for weights, other in (
            (_level(person.weight, "weight"), weight),
            ("averageweight", 1 - weight),
        ):
            if share * other > 0:
                name = f"universal-{person.sex}-young-{muscles}-{weights}"
                shaped = shaped + share * other * read_target(folder, name, count)
    if person.height:
        name = f"height/{person.sex}-young-{average}-{_level(person.height, 'height')}"
        shaped = shaped + abs(person.height) * read_target(folder, name, count)
    return shaped


def _level(value: float, kind: str) -> str:
    return ("max" if value > 0 else "min") + kind


def turns_to_human_rest(heads_m: Mapping[str, NDArray]) -> dict[str, FloatArray]:
    """Turn (3, 3) of every bone with a head (3,), m, from MakeHuman's rest to the human tree's."""
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


def native_dofs(bone: str, parent: str, turns: Mapping[str, FloatArray]) -> tuple[Dof, ...]:
    """Degrees of freedom of a bone in MakeHuman's rest pose: those of its part in the human tree,
    their axes and limits seen from that pose. A bone that continues its part has none.

    Args:
        turns: as `turns_to_human_rest` gives them.
    """
    part = PART_OF_BONE.get(bone)
    if part is None or part == PART_OF_BONE.get(parent):
        return ()
    dofs = [dof for number, dof in HUMAN.dofs if HUMAN.names[number] == part]
    # A rotation R from the human rest pose is turns[parent]ᵀ R turns[bone] from MakeHuman's.
    offset = Rotation.from_matrix(turns[parent].T @ turns[bone]).as_rotvec(degrees=True)
    result = []
    for dof in dofs:
        axis = turns[bone].T @ np.array(dof.axis)
        shift = float(axis @ offset)
        low, high = dof.limits_deg
        x, y, z = axis.tolist()
        result.append(replace(dof, axis=(x, y, z), limits_deg=(low + shift, high + shift)))
    return tuple(result)


def human_rest(
    names: Sequence[str], heads_m: FloatArray, vertices_m: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
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
    joints: FloatArray, vertices: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The rig has one bone where the tree has two parts: the upper half is the abdomen's."""
    lumbar, abdomen, thorax = (HUMAN.names.index(n) for n in ("lumbar", "abdomen", "thorax"))
    joints[abdomen] = (joints[lumbar] + joints[thorax]) / 2
    half = (joints[thorax, 2] - joints[lumbar, 2]) / 4
    share = np.clip((vertices[:, 2] - joints[abdomen, 2]) / (2 * half) + 0.5, 0, 1)
    weights[:, abdomen] = weights[:, lumbar] * share
    weights[:, lumbar] *= 1 - share
    return joints, vertices, weights


def _frame(along: FloatArray, hinge: FloatArray) -> FloatArray:
    """Rotation (3, 3) whose first column points along, its second along the hinge."""
    first = along / np.linalg.norm(along)
    second = hinge - (hinge @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)
