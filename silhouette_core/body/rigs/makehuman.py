"""Bodies of MakeHuman's data folder, on a rig of its own or on this project's human tree."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.body.joints import HUMAN, LANDMARK_BONES, LANDMARK_NAMES
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.cmu_bones import (
    PART_OF_BONE,
    human_rest,
    native_dofs,
    turns_to_human_rest,
)
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
    part_of_faces,
    short,
    strongest_four,
)
from silhouette_core.body.rigs.rig_dofs import ball_joint

CMU = "cmu_mb"
ORIGINS = ("african", "asian", "caucasian")
_FREE_DEG = 120


@dataclass(frozen=True)
class MakeHumanPerson:
    """What MakeHuman makes a body from.

    Attributes:
        sex: "male" or "female".
        height: -1 (smallest) to 1 (tallest); 0 is the average of the sex.
        weight: -1 (lightest) to 1 (heaviest).
        muscle: -1 (least) to 1 (most).
        origin: "african", "asian" or "caucasian".

    Raises:
        InputError: something that MakeHuman does not make.
    """

    sex: str = "male"
    height: float = 0.0
    weight: float = 0.0
    muscle: float = 0.0
    origin: str = "caucasian"

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
    """Body of a MakeHuman data folder, standing on the ground.

    Args:
        person: the body's shape; None: an average man.
        rig: name of the rig in rigs/standard, whose bones become the parts.
        human: whether the body goes onto this project's human tree instead (only from the rig
            "cmu_mb"): its 27 parts, names, limits and rest pose, to which the arms are turned.

    Returns:
        The body. On the rig "cmu_mb", and on the human tree, its landmarks are the 15 of
        `joints.LANDMARK_NAMES`, else every bone's head.

    Raises:
        InputError: a file is missing or damaged, or there is no such body.
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
        dofs = [(k, dof) for k in range(1, len(names)) for dof in ball_joint(_FREE_DEG)]
        every = np.arange(len(names), dtype=np.int32)
        tree = KinematicTree(
            tuple(names),
            parents,
            tuple(dofs),
            tuple(names),
            every,
            np.stack([parents[1:], every[1:]], axis=1),
        )
        return skin.body(tree, skin.heads_m)
    if missing := [bone for bone in PART_OF_BONE if bone not in names]:
        raise InputError(f"{path} lacks the bone {missing[0]!r}: give MakeHuman's own rig")
    return skin.on_human_tree() if human else skin.on_cmu_tree(parents)


@dataclass(frozen=True, eq=False)
class _Skin:
    """A shaped mesh and the bones that move it, standing on the ground."""

    names: list[str]
    heads_m: NDArray[np.float64]
    vertices_m: NDArray[np.float64]
    faces: NDArray[np.int64]
    weights: NDArray[np.float64]

    def body(self, tree: KinematicTree, landmarks_m: NDArray[np.float64]) -> BodyModel:
        """The body on a tree whose parts are these bones."""
        every = np.broadcast_to(np.arange(self.weights.shape[1]), self.weights.shape)
        parts, weights = strongest_four(every, self.weights)
        part = part_of_faces(self.faces, parts, weights)
        skin = parts, weights
        return BodyModel.as_given(
            tree, self.heads_m, self.vertices_m, self.faces, part, skin, landmarks_m
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

    def _landmarks(self, joints_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Landmarks (15, 3): the joints of their parts, and the highest vertex."""
        marks = joints_m.copy()
        marks[LANDMARK_NAMES.index("head_top")] = self.vertices_m[self.vertices_m[:, 2].argmax()]
        return marks


def _shaped(folder: Path, mesh: BaseMesh, person: MakeHumanPerson) -> NDArray[np.float64]:
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
