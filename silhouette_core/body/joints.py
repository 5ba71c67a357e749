"""The articulated tree: 27 parts, and how far each joint turns.

Every part owns the joint at its proximal end. A joint turns by `Exp(sum_k q_k axis_k)`, the axes given in the body frame of the rest
pose (z up, facing -y, left hand toward +x; arms 45 degrees below the horizontal). Positive angles mean the anatomical movement named.
Limits are ranges of a healthy adult, rounded outward (Kapandji, The Physiology of the Joints; AAOS, Joint Motion).
"""

from dataclasses import dataclass

import numpy as np

_ARM = np.sqrt(0.5)  # the rest pose holds the arms 45 degrees below the horizontal


@dataclass(frozen=True)
class Freedom:
    """One degree of freedom of a joint.

    Attributes:
        name: the anatomical movement that a positive angle makes.
        axis: unit vector in the body frame of the rest pose.
        limits_deg: smallest and largest angle.
        held: True where silhouettes do not show it; the estimators then leave it at rest.
    """

    name: str
    axis: tuple[float, float, float]
    limits_deg: tuple[float, float]
    held: bool = False


_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_TRUNK = ("flexion", _X), ("lateral", _Y), ("rotation", _Z)


def _trunk(flexion: tuple[float, float], lateral: float, rotation: float, held: bool = False) -> tuple[Freedom, ...]:
    limits = flexion, (-lateral, lateral), (-rotation, rotation)
    return tuple(Freedom(name, axis, span, held) for (name, axis), span in zip(_TRUNK, limits, strict=True))


_SPINE: tuple[tuple[str, str, tuple[Freedom, ...]], ...] = (
    ("pelvis", "", ()),
    ("lumbar", "pelvis", _trunk((-25, 55), 25, 20)),
    ("abdomen", "lumbar", _trunk((-10, 20), 10, 10, held=True)),
    ("thorax", "abdomen", _trunk((-20, 35), 20, 30)),
    ("upper_thorax", "thorax", _trunk((-10, 15), 8, 10, held=True)),
    ("neck", "upper_thorax", _trunk((-50, 55), 35, 50)),
    ("head", "neck", _trunk((-25, 25), 15, 35, held=True)),
)
_LEFT: tuple[tuple[str, str, tuple[Freedom, ...]], ...] = (
    ("clavicle", "upper_thorax", (Freedom("elevation", (0, -1, 0), (-12, 40)), Freedom("protraction", (0, 0, -1), (-22, 25)))),
    (
        "upper_arm",
        "clavicle",
        (
            Freedom("abduction", (0, -1, 0), (-75, 140)),
            Freedom("forward", (-_ARM, 0, -_ARM), (-75, 135)),
            Freedom("twist", (_ARM, 0, -_ARM), (-95, 95)),
        ),
    ),
    (
        "forearm",
        "upper_arm",
        (Freedom("flexion", (-_ARM, 0, -_ARM), (-5, 150)), Freedom("pronation", (_ARM, 0, -_ARM), (-85, 85), held=True)),
    ),
    (
        "hand",
        "forearm",
        (Freedom("flexion", (-_ARM, 0, -_ARM), (-70, 75)), Freedom("deviation", (0, -1, 0), (-30, 20))),
    ),
    ("thumb", "hand", (Freedom("flexion", (0, -1, 0), (-20, 50), held=True),)),
    ("fingers", "hand", (Freedom("flexion", (-_ARM, 0, -_ARM), (-10, 90), held=True),)),
    (
        "thigh",
        "pelvis",
        (
            Freedom("flexion", (-1, 0, 0), (-35, 130)),
            Freedom("abduction", (0, -1, 0), (-35, 70)),
            Freedom("rotation", (0, 0, 1), (-50, 50)),
        ),
    ),
    ("shin", "thigh", (Freedom("flexion", _X, (-3, 155)),)),
    ("foot", "shin", (Freedom("dorsiflexion", (-1, 0, 0), (-55, 35)), Freedom("eversion", (0, -1, 0), (-30, 25)))),
    ("toes", "foot", (Freedom("extension", (-1, 0, 0), (-30, 60), held=True),)),
)


def _side(side: str) -> tuple[tuple[str, str, tuple[Freedom, ...]], ...]:
    sign = 1.0 if side == "left" else -1.0
    own = {name for name, _, _ in _LEFT}
    # A rotation axis is a pseudo-vector: mirroring x turns its y and z parts round.
    mirrored = lambda f: Freedom(f.name, (f.axis[0], sign * f.axis[1], sign * f.axis[2]), f.limits_deg, f.held)  # noqa: E731
    return tuple(
        (f"{side}_{name}", f"{side}_{parent}" if parent in own else parent, tuple(mirrored(f) for f in freedoms))
        for name, parent, freedoms in _LEFT
    )


TREE = _SPINE + _side("left") + _side("right")
PART_NAMES = tuple(name for name, _, _ in TREE)
PARENTS = np.array([PART_NAMES.index(parent) if parent else -1 for _, parent, _ in TREE], np.int32)
FREEDOMS = tuple((part, freedom) for part, (_, _, freedoms) in enumerate(TREE) for freedom in freedoms)

LANDMARK_NAMES = tuple(
    "pelvis left_hip left_knee left_ankle right_hip right_knee right_ankle neck head_top left_shoulder left_elbow left_wrist "
    "right_shoulder right_elbow right_wrist".split()
)
"""The 15 joints of the HumanEva protocol (Sigal, Balan and Black, IJCV 2010), in the order of every (…, 15, 3) array."""

_LANDMARK_OF = {"hip": "thigh", "knee": "shin", "ankle": "foot", "shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand"}


def landmark_part(landmark: str) -> int:
    """Returns the index of the part that carries a landmark of `LANDMARK_NAMES`."""
    side, _, joint = landmark.partition("_")
    if joint in _LANDMARK_OF:
        return PART_NAMES.index(f"{side}_{_LANDMARK_OF[joint]}")
    return PART_NAMES.index({"pelvis": "pelvis", "neck": "neck", "head_top": "head"}[landmark])


LANDMARK_PART = np.array([landmark_part(name) for name in LANDMARK_NAMES], np.int32)
