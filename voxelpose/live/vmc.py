"""Frames as messages of the VMC protocol (Virtual Motion Capture), OSC in UDP datagrams.

Source: VMC protocol specification, protocol.vmc.info, performer to marionette.
"""

from collections.abc import Iterator

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder

from voxelpose.live.humanoid import BONE_NAMES, humanoid_pose
from voxelpose.live.live_frame import LiveFrame

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
