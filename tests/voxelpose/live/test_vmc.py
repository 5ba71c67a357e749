"""VMC datagrams, read by another OSC library and compared with the protocol's list of messages."""

import numpy as np
import pytest
from oscpy.parser import read_packet

from tests.voxelpose.live.live_scenes import bare_frame, posed
from voxelpose.live.messages import BONE_NAMES, vmc_datagrams

# Performer to marionette, of protocol.vmc.info: the address, and the types of its arguments.
PROTOCOL = {"/VMC/Ext/OK": "i", "/VMC/Ext/T": "f"}
PROTOCOL |= {"/VMC/Ext/Root/Pos": "sfffffff", "/VMC/Ext/Bone/Pos": "sfffffff"}
OWN = {"/voxelpose/confidence": "f"}


def messages(datagrams: list[bytes]) -> list[tuple[str, str, list]]:
    """Address, types and values of every message."""
    found = []
    for datagram in datagrams:
        assert datagram.startswith(b"#bundle\0") and len(datagram) <= 1400
        for address, types, values, _ in read_packet(datagram, encoding="utf8"):
            texts = (one.decode() if isinstance(one, bytes) else one for one in (address, types))
            found.append((*texts, list(values)))
    return found


def test_messages_are_those_of_the_protocol():
    for body in (None, posed({"left_thigh.flexion": 20.0})):
        found = messages(vmc_datagrams(bare_frame(body=body)))
        for address, types, _ in found:
            assert types.lstrip(",") == {**PROTOCOL, **OWN}[address]
        assert [address for address, _, _ in found][-2:] == ["/VMC/Ext/OK", "/VMC/Ext/T"]


def test_values_arrive():
    body = posed({"right_shin.flexion": 33.0}, root_m=(0.5, -1.0, 0.95))
    found = messages(vmc_datagrams(bare_frame(50, body)))
    bones = [values for address, _, values in found if address == "/VMC/Ext/Bone/Pos"]
    assert tuple(values[0] for values in bones) == BONE_NAMES
    assert bones[0][1:4] == pytest.approx([-0.5, 0.95, 1.0])
    for values in bones:
        assert np.linalg.norm(values[4:]) == pytest.approx(1, abs=1e-6)
    by_name = {values[0]: values[4:] for values in bones}
    angle = np.radians(33 / 2)
    assert by_name["RightLowerLeg"] == pytest.approx([np.sin(angle), 0, 0, np.cos(angle)], abs=1e-6)
    single = {address: values for address, _, values in found if not address.endswith("/Pos")}
    assert single["/VMC/Ext/OK"] == [1] and single["/VMC/Ext/T"] == [2.0]
    assert single["/voxelpose/confidence"] == [0.875]
    root = next(values for address, _, values in found if address == "/VMC/Ext/Root/Pos")
    assert root == ["root", 0, 0, 0, 0, 0, 0, 1]


def test_without_a_body_there_are_no_bones():
    found = messages(vmc_datagrams(bare_frame()))
    assert [(address, values) for address, _, values in found] == [
        ("/voxelpose/confidence", [0.0]),
        ("/VMC/Ext/OK", [1]),
        ("/VMC/Ext/T", [pytest.approx(3 / 25)]),
    ]
