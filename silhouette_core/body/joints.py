"""The human body's kinematic tree: 27 parts, the ranges of their joints, 15 landmarks.

Every part has the joint at its proximal end. A joint rotates by `Exp(sum_k q_k axis_k)`, the axes
given in the body frame of the rest pose (z up, facing -y, left hand toward +x; arms 45 degrees
below the horizontal). Positive angles mean the anatomical movement named. Limits are ranges of a
healthy adult, rounded outward (Kapandji, The Physiology of the Joints; AAOS, Joint Motion).
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from silhouette_core.body.kinematic_tree import Dof, KinematicTree

_ARM = np.sqrt(1 / 2)  # the rest pose holds the arms 45 degrees below the horizontal


_X, _Y, _Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
SIDES = "left", "right"
_TRUNK = ("flexion", _X), ("lateral", _Y), ("rotation", _Z)


def _trunk(
    flexion: tuple[float, float], lateral: float, rotation: float, fixed: bool = False
) -> tuple[Dof, ...]:
    limits = flexion, (-lateral, lateral), (-rotation, rotation)
    return tuple(
        Dof(name, axis, span, fixed) for (name, axis), span in zip(_TRUNK, limits, strict=True)
    )


_SPINE: tuple[tuple[str, str, tuple[Dof, ...]], ...] = (
    ("pelvis", "", ()),
    ("lumbar", "pelvis", _trunk((-25, 55), 25, 20)),
    ("abdomen", "lumbar", _trunk((-10, 20), 10, 10, fixed=True)),
    ("thorax", "abdomen", _trunk((-20, 35), 20, 30)),
    ("upper_thorax", "thorax", _trunk((-10, 15), 8, 10, fixed=True)),
    ("neck", "upper_thorax", _trunk((-50, 55), 35, 50)),
    ("head", "neck", _trunk((-25, 25), 15, 35, fixed=True)),
)
_ARM_CHAINS = "upper_thorax clavicle upper_arm forearm hand thumb", "hand fingers"
_LIMBS = {
    part: parent
    for chain in (*_ARM_CHAINS, "pelvis thigh shin foot toes")
    for parent, part in pairwise(chain.split())
}  # part of either side -> its parent
_LEFT_DOFS = (
    ("clavicle", Dof("elevation", (0, -1, 0), (-12, 40))),
    ("clavicle", Dof("protraction", (0, 0, -1), (-22, 25))),
    ("upper_arm", Dof("abduction", (0, -1, 0), (-75, 140))),
    ("upper_arm", Dof("forward", (-_ARM, 0, -_ARM), (-75, 135))),
    ("upper_arm", Dof("twist", (_ARM, 0, -_ARM), (-95, 95))),
    ("forearm", Dof("flexion", (-_ARM, 0, -_ARM), (-5, 150))),
    ("forearm", Dof("pronation", (_ARM, 0, -_ARM), (-85, 85), fixed=True)),
    ("hand", Dof("flexion", (-_ARM, 0, -_ARM), (-70, 75))),
    ("hand", Dof("deviation", (0, -1, 0), (-30, 20))),
    ("thumb", Dof("flexion", (0, -1, 0), (-20, 50), fixed=True)),
    ("fingers", Dof("flexion", (-_ARM, 0, -_ARM), (-10, 90), fixed=True)),
    ("thigh", Dof("flexion", (-1, 0, 0), (-35, 130))),
    ("thigh", Dof("abduction", (0, -1, 0), (-35, 70))),
    ("thigh", Dof("rotation", (0, 0, 1), (-50, 50))),
    ("shin", Dof("flexion", _X, (-3, 155))),
    ("foot", Dof("dorsiflexion", (-1, 0, 0), (-55, 35))),
    ("foot", Dof("eversion", (0, -1, 0), (-30, 25))),
    ("toes", Dof("extension", (-1, 0, 0), (-30, 60), fixed=True)),
)


def _side(side: str) -> tuple[tuple[str, str, tuple[Dof, ...]], ...]:
    sign = 1.0 if side == "left" else -1.0

    # A rotation axis is a pseudo-vector: mirroring x changes the signs of its y and z.
    def mirrored(dof: Dof) -> Dof:
        x, y, z = dof.axis
        return replace(dof, axis=(x, sign * y, sign * z))

    return tuple(
        (
            f"{side}_{name}",
            f"{side}_{parent}" if parent in _LIMBS else parent,
            tuple(mirrored(dof) for part, dof in _LEFT_DOFS if part == name),
        )
        for name, parent in _LIMBS.items()
    )


_PARTS = _SPINE + _side("left") + _side("right")
PART_NAMES = tuple(name for name, _, _ in _PARTS)
PARENTS = np.array(
    [PART_NAMES.index(parent) if parent else -1 for _, parent, _ in _PARTS], np.int32
)

ARM_PARTS = tuple(
    PART_NAMES.index(f"{side}_{name}")
    for side in SIDES
    for name in ("upper_arm", "forearm", "hand", "thumb", "fingers")
)
"""Indices of the parts of both arms, without the clavicles."""

LANDMARK_NAMES = tuple(
    "pelvis left_hip left_knee left_ankle right_hip right_knee right_ankle neck head_top"
    " left_shoulder left_elbow left_wrist right_shoulder right_elbow right_wrist".split()
)
"""The 15 joints of the HumanEva protocol (Sigal, Balan and Black, IJCV 2010), in the order of every
(…, 15, 3) array.
"""

_LANDMARK_OF = {
    "hip": "thigh",
    "knee": "shin",
    "ankle": "foot",
    "shoulder": "upper_arm",
    "elbow": "forearm",
    "wrist": "hand",
}


def landmark_part(landmark: str) -> int:
    """Index of the part that carries a landmark of `LANDMARK_NAMES`."""
    side, _, joint = landmark.partition("_")
    if joint in _LANDMARK_OF:
        return PART_NAMES.index(f"{side}_{_LANDMARK_OF[joint]}")
    return PART_NAMES.index({"pelvis": "pelvis", "neck": "neck", "head_top": "head"}[landmark])


def without_side(name: str) -> str:
    """Name of a part or angle that is the same for both sides."""
    return name.removeprefix("left_").removeprefix("right_")


def exchanged_sides(names: tuple[str, ...]) -> list[int]:
    """For each name the number of that of the other side; of the middle its own."""
    other = {"left": "right", "right": "left"}
    parts = [name.partition("_") for name in names]
    return [names.index(other.get(side, side) + mark + rest) for side, mark, rest in parts]


EXCHANGED_LANDMARKS = np.array(exchanged_sides(LANDMARK_NAMES))
"""For each landmark the one of the other side; of the middle itself."""

LANDMARK_PART = np.array([landmark_part(name) for name in LANDMARK_NAMES], np.int32)

_CHAINS = (
    "pelvis neck head_top",
    *(f"neck {side}_shoulder {side}_elbow {side}_wrist" for side in SIDES),
    *(f"pelvis {side}_hip {side}_knee {side}_ankle" for side in SIDES),
)
LANDMARK_BONES = np.array(
    [
        [LANDMARK_NAMES.index(name) for name in bone]
        for chain in _CHAINS
        for bone in pairwise(chain.split())
    ]
)
"""(14, 2) int, the bones between the 15 joints of joints.csv."""

HUMAN = KinematicTree(
    PART_NAMES,
    PARENTS,
    tuple((part, dof) for part, (_, _, dofs) in enumerate(_PARTS) for dof in dofs),
    LANDMARK_NAMES,
    LANDMARK_PART,
    LANDMARK_BONES,
)
"""The kinematic tree of a person."""
