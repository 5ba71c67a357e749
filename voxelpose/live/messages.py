"""Frames as messages: lines of JSON, of the schema that docs/live.md describes, and those of the
VMC protocol (Virtual Motion Capture), OSC in UDP datagrams.

Source: VMC protocol specification, protocol.vmc.info, performer to marionette.
"""

from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.kinematics import quaternions, relative_rotations
from voxelpose.live.humanoid import BONE_NAMES, humanoid_pose
from voxelpose.live.live_frame import LiveFrame, PosedBody

SCHEMA_VERSION = 1


def json_message(frame: LiveFrame, sent_unix_s: float) -> str:
    """One frame, sent at a Unix time, as a line of JSON that ends with a line feed.

    Returns:
        The object that docs/live.md describes; numbers that are not finite are null.
    """
    message = {
        "format": "voxelpose live",
        "version": SCHEMA_VERSION,
        "number": frame.number,
        "time_s": _rounded(frame.time_s),
        "captured_unix_s": _rounded(frame.captured_unix_s),
        "sent_unix_s": _rounded(sent_unix_s),
        "note": frame.note,
        "body": None if frame.body is None else _body(frame.body),
    }
    return msgspec.json.encode(message).decode() + "\n"


def _body(body: PosedBody) -> dict[str, object]:
    model, pose = body.model, body.pose
    joints = zip(_rounded(body.joints_m), _rounded(body.joint_confidence), strict=True)
    turns = _rounded(quaternions(relative_rotations(body.part_rotation, model.parents)))
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
        "angles_rad": dict(zip(model.dof_names, _rounded(pose.angles_rad), strict=True)),
    }


def _rounded(values: ArrayLike) -> Any:
    """Numbers as lists, to a hundredth of a millimetre; JSON has those not finite as null."""
    return np.round(np.asarray(values, float), 5).tolist()


_MOST_BYTES = 1400  # of a bundle: one network packet holds it, with its headers
_BUNDLE_BYTES, _SIZE_BYTES = 16, 4  # head of a bundle, and the size before each message


def vmc_datagrams(frame: LiveFrame) -> list[bytes]:
    """One frame as datagrams, each an OSC bundle of at most 1400 bytes.

    The root stays at the world's origin and the hips carry position and heading. `/VMC/Ext/T` comes
    last, since some receivers draw at it. Without a body there are no bones: a receiver then keeps
    its last pose. `/voxelpose/confidence` is an address of our own, which receivers ignore, as the
    protocol asks them to.
    """
    bundles: list[OscBundleBuilder] = []
    room = 0
    for message in _messages(frame):
        needed = _SIZE_BYTES + message.size
        if needed > room:
            bundles.append(OscBundleBuilder(IMMEDIATELY))
            room = _MOST_BYTES - _BUNDLE_BYTES
        bundles[-1].add_content(message)
        room -= needed
    return [bundle.build().dgram for bundle in bundles]


def _messages(frame: LiveFrame) -> Iterator[OscMessage]:
    body = frame.body
    if body is not None:
        pose = humanoid_pose(body)
        root = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0  # position, quaternion
        yield _message("/VMC/Ext/Root/Pos", "root", *root)
        for name, position, rotation in zip(
            BONE_NAMES, pose.position_m.tolist(), pose.rotation_xyzw.tolist(), strict=True
        ):
            yield _message("/VMC/Ext/Bone/Pos", name, *position, *rotation)
    yield _message("/voxelpose/confidence", 0.0 if body is None else float(body.confidence))
    yield _message("/VMC/Ext/OK", 1)
    yield _message("/VMC/Ext/T", float(frame.time_s))


def _message(address: str, *values: str | int | float) -> OscMessage:
    """Message whose arguments have the types of the values: string, int32, float32."""
    builder = OscMessageBuilder(address)
    for value in values:
        kind = "s" if isinstance(value, str) else "i" if isinstance(value, int) else "f"
        builder.add_arg(value, kind)
    return builder.build()
