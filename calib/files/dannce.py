"""DANNCE's calibration as MATLAB's files: `*_dannce.mat` with all cameras, `params` beside their
names `camnames`; or a file for each, `hires_cam1_params.mat`.

`K`, `r` and `t` are MATLAB's of row vectors: x_cam = x_world r + t, pixels = x_cam K, so that K and
r are the transposes of OpenCV's. Pixels count from 1. `RDistort` is k1 k2 or k1 k2 k3, `TDistort`
p1 p2, as OpenCV's. Size and unit are not in the file; DANNCE itself works in mm.

MATLAB's files of version 5 (-v6, -v7) are read without SciPy: a damaged one ends its process.
Source: MathWorks, MAT-File Format, R2023a.
"""

import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from calib.camera import Camera, Rig
from calib.files.fields import Source
from calib.storage.documents import LARGEST_CALIBRATION, load_bytes

# Types of numbers in the order of their codes, from 1; those that are reserved are bytes.
_NUMBERS = dict(enumerate("i1 u1 i2 u2 i4 u4 f4 u1 f8 u1 u1 i8 u8".split(), 1))
_COMPRESSED = 15
_CELL, _STRUCT, _CHAR = 1, 2, 4
_BEGIN = 128  # bytes before the first element
_CAMERA = ("K", "r", "t", "RDistort", "TDistort")
_DAMAGED = (ArithmeticError, LookupError, RecursionError, StopIteration, TypeError, ValueError)
_DAMAGED += (struct.error, zlib.error)


def is_matlab(path: Path) -> bool:
    """Whether a file is one of MATLAB's."""
    with suppress(OSError), path.open("rb") as file:
        return file.read(6) == b"MATLAB"
    return False


def read_dannce(source: Source) -> Rig:
    """Reads the rig. InputError where a camera is missing, incomplete or wrong, or the unit is not
    given.
    """
    content = load_dannce(source)
    if is_dannce_camera(content) or "params" not in content:
        return source.rig([dannce_camera(source, source.path.stem, content)])
    params, names = content["params"], content.get("camnames")
    cells = params if isinstance(params, list) else [params]
    cameras = [one for cell in cells for one in (cell if isinstance(cell, list) else [cell])]
    if (
        not all(isinstance(camera, dict) for camera in cameras)
        or not isinstance(names, list)
        or len(names) != len(cameras)
    ):
        raise source.error(
            f"params must be a cell array of structs ({', '.join(_CAMERA)}), camnames their names"
        )
    named = zip(map(str, names), cameras, strict=True)
    return source.rig([dannce_camera(source, name, camera) for name, camera in named])


def load_dannce(source: Source) -> dict[str, Any]:
    """Variables of a calibration of DANNCE's. InputError where the file cannot be read."""
    return _load_matlab(source, (*_CAMERA, "params", "camnames"))


def is_dannce_camera(content: dict[str, Any]) -> bool:
    """Whether variables are one camera's."""
    return {*_CAMERA} <= content.keys()


def dannce_camera(source: Source, name: str, fields: dict[str, Any]) -> Camera | None:
    """Camera from its variables. InputError where it is incomplete or wrong."""
    matrix = source.numbers(name, "K", fields.get("K"), (3, 3)).T
    if matrix[2, :2].any() and not matrix[:2, 2].any():
        raise source.error("K is not transposed as MATLAB's is: write K'", name)
    radial = source.numbers(name, "RDistort", fields.get("RDistort"))
    tangential = source.numbers(name, "TDistort", fields.get("TDistort"), (2,))
    values = {
        "matrix": matrix - np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]]),
        "distortions": np.r_[radial[:2], tangential, radial[2:]],
        "rotation": source.numbers(name, "r", fields.get("r"), (3, 3)).T,
        "translation": fields.get("t"),
    }
    return source.camera(name, values, source.metres_per_unit(None, "DANNCE works in mm:"))


def _load_matlab(source: Source, wanted: Collection[str]) -> dict[str, Any]:
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
    except _DAMAGED:
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
