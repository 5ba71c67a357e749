"""The body as a humanoid of Unity: bones, their axes and their T-pose.

Unity is left-handed, y up, metres; a humanoid faces +z, its left hand toward -x. Its bones have no
rotation in the T-pose (VRM's normalised bones): upright, legs straight down, arms horizontal to the
sides, palms down.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import PART_NAMES
from silhouette_core.motion.kinematics import quaternions, relative_rotations
from voxelpose.live.live_frame import PosedBody

UNITY_FROM_WORLD = np.array([[-1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""Axes of Unity: (x, y, z) becomes (-x, z, -y). A body that faces -y in the world then faces +z,
its left hand toward -x. The determinant is -1: the handedness changes.
"""

_BONES = (
    ("Hips", "", "pelvis"),
    ("Spine", "Hips", "lumbar"),
    ("Chest", "Spine", "thorax"),
    ("UpperChest", "Chest", "upper_thorax"),
    ("Neck", "UpperChest", "neck"),
    ("Head", "Neck", "head"),
)
_LIMBS = (
    ("Shoulder", "UpperChest", "clavicle"),
    ("UpperArm", "Shoulder", "upper_arm"),
    ("LowerArm", "UpperArm", "forearm"),
    ("Hand", "LowerArm", "hand"),
    ("UpperLeg", "Hips", "thigh"),
    ("LowerLeg", "UpperLeg", "shin"),
    ("Foot", "LowerLeg", "foot"),
    ("Toes", "Foot", "toes"),
)
_LIMB_NAMES = {name for name, _, _ in _LIMBS}
_ALL = _BONES + tuple(
    (side + name, side + parent if parent in _LIMB_NAMES else parent, f"{side.lower()}_{part}")
    for side in ("Left", "Right")
    for name, parent, part in _LIMBS
)

BONE_NAMES = tuple(name for name, _, _ in _ALL)
"""The 22 bones, named as in Unity's `HumanBodyBones`; a parent stands before its children."""

BONE_PARTS = np.array([PART_NAMES.index(part) for _, _, part in _ALL], np.int32)
"""(22,) the part of the body that each bone follows. The abdomen's turn is in the chest's."""

BONE_PARENTS = np.array(
    [BONE_NAMES.index(parent) if parent else -1 for _, parent, _ in _ALL], np.int32
)
"""(22,) the parent of each bone; -1 for the hips."""


def _rest_from_t_pose() -> NDArray[np.float64]:
    """World rotations (22, 3, 3) that lower the arms of the T-pose to those of the rest pose."""
    turns = np.tile(np.eye(3), (len(BONE_NAMES), 1, 1))
    for k, name in enumerate(BONE_NAMES):
        if name.endswith(("Arm", "Hand")):
            # The rest pose holds the arms 45 degrees below the horizontal (`body.joints`).
            angle = np.pi / 4 if name.startswith("Left") else -np.pi / 4
            turns[k] = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    return turns


_REST_FROM_T_POSE = _rest_from_t_pose()


@dataclass(frozen=True, eq=False)
class HumanoidPose:
    """Local transforms of the bones, as Unity has them.

    Attributes:
        position_m: (22, 3) float64, of each bone's joint in its parent's axes; the hips' in the
            world, Unity's axes.
        rotation_xyzw: (22, 4) float64, quaternions x, y, z, w, parent from bone; the identity in
            the T-pose. The hips' are world from bone.
    """

    position_m: NDArray[np.float64]
    rotation_xyzw: NDArray[np.float64]


def humanoid_pose(body: PosedBody) -> HumanoidPose:
    r"""A body's pose on a humanoid whose bones rest in the T-pose.

    A bone must point where the part points, so that it turns from the T-pose to the rest pose first
    and then as the part does:

    .. math:: G_b = M R_{p(b)} A_b M^\top, \qquad L_b = G_{\mathrm{parent}(b)}^\top G_b

    with the part's rotation :math:`R_p`, the turn :math:`A_b` from T-pose to rest pose (45 degrees
    for arms, forearms and hands, else none) and Unity's axes :math:`M`. Twist of forearm and hand
    is left to the humanoid: silhouettes do not show it.
    """
    turned = body.part_rotation[BONE_PARTS] @ _REST_FROM_T_POSE
    world = UNITY_FROM_WORLD @ turned @ UNITY_FROM_WORLD.T
    origin = body.part_origin_m[BONE_PARTS] @ UNITY_FROM_WORLD.T
    local, offset = relative_rotations(world, BONE_PARENTS), origin.copy()
    children = BONE_PARENTS >= 0
    parents = BONE_PARENTS[children]
    between = origin[children] - origin[parents]
    offset[children] = np.einsum("bji,bj->bi", world[parents], between)
    return HumanoidPose(offset, quaternions(local)[:, [1, 2, 3, 0]])
