"""MATLAB's files of version 5 (-v6, -v7), read without SciPy: a damaged one ends its process.

Source: MathWorks, MAT-File Format, R2023a.
"""

import struct
import zlib
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from calib.files.fields import Source
from calib.storage.documents import LARGEST_CALIBRATION, load_bytes

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8"}
_NUMBERS |= {13: "u8"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _CHAR = 1, 2, 4
_BEGIN = 128  # bytes before the first element


def load_matlab(source: Source, wanted: Collection[str]) -> dict[str, Any]:
    """Variables of a file by name: arrays of numbers, strings, lists (cells), and lists of
    dictionaries (structs). InputError where the file cannot be read.
    """
    data = load_bytes(source.path, LARGEST_CALIBRATION)
    if data.startswith(b"MATLAB 7.3"):
        raise source.error("is MATLAB's of version 7.3: save it with -v7")
    order, content = ">" if data[_BEGIN - 2 : _BEGIN] == b"MI" else "<", {}
    try:
        for kind, inner in _elements(data[_BEGIN:], order):
            if kind == _COMPRESSED:
                whole = zlib.decompressobj().decompress(inner, LARGEST_CALIBRATION)
                inner = next(_elements(whole, order))[1]
            name, value = _variable(inner, order, wanted)
            content[name] = value
    except (ArithmeticError, LookupError, RecursionError, StopIteration, TypeError, ValueError):
        content = {}
    except (struct.error, zlib.error):
        content = {}
    if not content:
        raise source.error("is no MATLAB file that can be read: save it again")
    return content


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yields type and content of elements."""
    begin = 0
    while begin + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, begin)
        if kind >> 16:  # a small one, in its own tag
            yield kind & 0xFFFF, data[begin + 4 : begin + 4 + min(kind >> 16, 4)]
            begin += 8
        else:
            yield kind, data[begin + 8 : begin + 8 + size]
            begin += 8 + size + (0 if kind == _COMPRESSED else -size % 8)


def _variable(data: bytes, order: str, wanted: Collection[str] | None = None) -> tuple[str, Any]:
    """Name and value of a variable, or of what a cell or a struct holds; None if not wanted."""
    if not data:
        return "", np.zeros((0, 0))
    flags, shape, label, *parts = _elements(data, order)
    name, kind = label[1].decode("latin-1"), flags[1][0 if order == "<" else 3]
    if wanted is not None and name not in wanted:
        return name, None
    if kind == _CELL:
        return name, [_variable(part, order)[1] for _, part in parts]
    if kind == _STRUCT:
        (_, length), (_, keys), *values = parts
        step = int.from_bytes(length, "little" if order == "<" else "big")
        names = [keys[k : k + step].split(b"\0")[0].decode() for k in range(0, len(keys), step)]
        items = [_variable(part, order)[1] for _, part in values]
        rows = range(0, len(items), len(names))
        return name, [dict(zip(names, items[k : k + len(names)], strict=True)) for k in rows]
    code, content = parts[0]
    numbers = np.frombuffer(content, order + _NUMBERS.get(code, "u1"))
    if kind == _CHAR:
        return name, "".join(map(chr, numbers.tolist()))
    return name, numbers.reshape(np.frombuffer(shape[1], f"{order}i4"), order="F")
