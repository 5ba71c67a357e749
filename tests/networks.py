"""Small networks in ONNX, written byte by byte, since nothing here needs the package onnx."""

import struct
from collections.abc import Sequence

_FLOAT, _INTS = 1, 7  # types of a tensor, of an attribute


def red_network(
    channels: int = 1, person: int = 0, size: tuple[int | str, int | str] = (64, 48)
) -> bytes:
    """A network that takes pictures (1, 3, height, width), RGB, and finds people where red is above
    the half and nothing else is: as logits, of `channels`, in that of the person.

    Args:
        channels: of the output.
        person: channel that is not 0.
        size: width and height of the pictures; text leaves them open.
    """
    red = [0.0] * (3 * channels)
    red[3 * person : 3 * person + 3] = 40.0, -20.0, -20.0
    shift = [0.0] * channels
    shift[person] = -10.0
    kernel = _field(1, "kernel_shape") + _field(8, 1) + _field(8, 1) + _field(20, _INTS)
    inputs = b"".join(_field(1, name) for name in ("picture", "weights", "shift"))
    conv = inputs + _field(2, "logits") + _field(4, "Conv") + _field(5, kernel)
    graph = (
        _field(1, conv)
        + _field(2, "red")
        + _field(5, _tensor("weights", (channels, 3, 1, 1), red))
        + _field(5, _tensor("shift", (channels,), shift))
        + _field(11, _value("picture", (1, 3, size[1], size[0])))
        + _field(12, _value("logits", (1, channels, size[1], size[0])))
    )
    opset = _field(1, "") + _field(2, 13)
    return _field(1, 8) + _field(7, graph) + _field(8, opset)


def _value(name: str, shape: Sequence[int | str]) -> bytes:
    """ValueInfoProto of a float tensor."""
    sides = b"".join(_field(1, _field(2 if isinstance(side, str) else 1, side)) for side in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, _FLOAT) + _field(2, sides)))


def _tensor(name: str, shape: Sequence[int], values: Sequence[float]) -> bytes:
    """TensorProto of float32."""
    sides = b"".join(_field(1, side) for side in shape)
    data = struct.pack(f"<{len(values)}f", *values)
    return sides + _field(2, _FLOAT) + _field(8, name) + _field(9, data)


def _field(number: int, value: int | str | bytes) -> bytes:
    """A field of a protobuf message."""
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    more, value = value >> 7, value & 127
    return bytes([value | 128]) + _varint(more) if more else bytes([value])
