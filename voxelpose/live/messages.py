"""Frames as messages: lines of JSON, of the schema that docs/live.md describes, and those of the
VMC protocol (Virtual Motion Capture), OSC in UDP datagrams.

VMC has the body as a humanoid of Unity, which is left-handed, y up, metres; a humanoid faces +z,
its left hand toward -x. Its bones have no rotation in the T-pose (VRM's normalised bones): upright,
legs straight down, arms horizontal to the sides, palms down.

Source: VMC protocol specification, protocol.vmc.info, performer to marionette.
"""

from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import build_msg
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.motion.kinematics import quaternions, relative_rotations
from voxelpose.live.live_frame import LiveFrame, PosedBody

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
SCHEMA_VERSION = 1
_MOST_BYTES = 1400  # of a bundle: one network packet holds it, with its headers
_BUNDLE_BYTES, _SIZE_BYTES = 16, 4  # head of a bundle, and the size before each message


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


def humanoid_pose(body: PosedBody) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""A body's pose on a humanoid whose bones rest in the T-pose.

    A bone must point where the part points, so that it turns from the T-pose to the rest pose first
    and then as the part does:

    .. math:: G_b = M R_{p(b)} A_b M^\top, \qquad L_b = G_{\mathrm{parent}(b)}^\top G_b

    with the part's rotation :math:`R_p`, the turn :math:`A_b` from T-pose to rest pose (45 degrees
    for arms, forearms and hands, else none) and Unity's axes :math:`M`. Twist of forearm and hand
    is left to the humanoid: silhouettes do not show it.

    Returns:
        Position (22, 3) float64, m, of each bone's joint in its parent's axes, and quaternion
        (22, 4) float64, x, y, z, w, parent from bone, the identity in the T-pose; those of the hips
        in the world, all by Unity's axes.
    """
    turned = body.part_rotation[BONE_PARTS] @ _REST_FROM_T_POSE
    world = UNITY_FROM_WORLD @ turned @ UNITY_FROM_WORLD.T
    origin = body.part_origin_m[BONE_PARTS] @ UNITY_FROM_WORLD.T
    local, offset = relative_rotations(world, BONE_PARENTS), origin.copy()
    children = BONE_PARENTS >= 0
    parents = BONE_PARENTS[children]
    between = origin[children] - origin[parents]
    offset[children] = np.einsum("bji,bj->bi", world[parents], between)
    return offset, quaternions(local)[:, [1, 2, 3, 0]]


def json_message(frame: LiveFrame, sent_unix_s: float, person: int = 0) -> str:
    """One frame, sent at a Unix time, as a line of JSON: see docs/live.md; not finite is null. Of
    several people, one of them, counted from 0.
    """
    body = frame.people[person]
    message = {
        "format": "voxelpose live",
        "version": SCHEMA_VERSION,
        "number": frame.number,
        "time_s": _rounded(frame.time_s),
        "captured_unix_s": _rounded(frame.captured_unix_s),
        "sent_unix_s": _rounded(sent_unix_s),
        "note": frame.note,
        **({"person": person + 1} if len(frame.people) > 1 else {}),
        "body": None if body is None else _body(body),
    }
    return msgspec.json.encode(message).decode() + "\n"


def _body(body: PosedBody) -> dict[str, object]:
    model, pose = body.model, body.pose
    joints = zip(_rounded(body.joints_m), _rounded(body.joint_confidence), strict=True)
    turns = _rounded(quaternions(relative_rotations(body.part_rotation, model.tree.parents)))
    return {
        "confidence": _rounded(body.confidence),
        "root": {
            "position_m": _rounded(pose.root_m),
            "rotation_wxyz": _rounded(quaternions(pose.root_rotation)),
        },
        "joints": {
            name: {"position_m": position, "confidence": confidence}
            for name, (position, confidence) in zip(LANDMARK_NAMES, joints, strict=True)
        },
        "local_rotations_wxyz": dict(zip(model.names, turns, strict=True)),
        "angles_rad": dict(zip(model.tree.dof_names, _rounded(pose.angles_rad), strict=True)),
    }


def _rounded(values: ArrayLike) -> Any:
    """Numbers as lists, to a hundredth of a millimetre; JSON has those not finite as null."""
    return np.round(np.asarray(values, float), 5).tolist()


def vmc_datagrams(frame: LiveFrame, person: int = 0) -> list[bytes]:
    """One frame as datagrams, each an OSC bundle of at most 1400 bytes; of several people, one of
    them, counted from 0.

    The root stays at the world's origin and the hips carry position and heading. `/VMC/Ext/T` comes
    last, since some receivers draw at it. Without a body there are no bones: a receiver then keeps
    its last pose. `/voxelpose/confidence` is an address of our own, which receivers ignore, as the
    protocol asks them to.
    """
    bundles: list[OscBundleBuilder] = []
    room = 0
    for message in _messages(frame.time_s, frame.people[person]):
        needed = _SIZE_BYTES + message.size
        if needed > room:
            bundles.append(OscBundleBuilder(IMMEDIATELY))
            room = _MOST_BYTES - _BUNDLE_BYTES
        bundles[-1].add_content(message)
        room -= needed
    return [bundle.build().dgram for bundle in bundles]


def _messages(time_s: float, body: PosedBody | None) -> Iterator[OscMessage]:
    if body is not None:
        places = zip(BONE_NAMES, *(part.tolist() for part in humanoid_pose(body)), strict=True)
        root = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0  # position, quaternion
        yield build_msg("/VMC/Ext/Root/Pos", ["root", *root])
        for name, position, rotation in places:
            yield build_msg("/VMC/Ext/Bone/Pos", [name, *position, *rotation])
    yield build_msg("/voxelpose/confidence", 0.0 if body is None else float(body.confidence))
    yield build_msg("/VMC/Ext/OK", 1)
    yield build_msg("/VMC/Ext/T", float(time_s))
