"""glTF and GLB documents: their JSON and the arrays of their accessors.

pygltflib, with which this project writes them, decodes no accessors and makes objects of whatever
JSON it is given; trimesh reads no skins.
"""

import base64
import binascii
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.documents import load_bytes, parse_json
from silhouette_core.body.rigs.rig_checks import short

_LARGEST = 200_000_000  # bytes of a document or a buffer
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": (), "VEC2": (2,), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}
_KNOWN = {"KHR_materials_unlit", "KHR_texture_transform", "KHR_materials_specular"}


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """A document of bounded size."""

    path: Path
    content: dict[str, Any]
    buffers: dict[int, bytes]  #: content of its buffers, as far as they are needed.

    @classmethod
    def read(cls, path: Path) -> "GltfDocument":
        """Document of a .glb or .gltf. Raises InputError where it cannot be read, or is none."""
        data = load_bytes(path, _LARGEST)
        buffers: dict[int, bytes] = {}
        if data[:4] == b"glTF":
            text, binary = _chunks(path, data)
            if binary is not None:
                buffers[0] = binary
        else:
            text = data
        try:
            content = parse_json(text.decode("utf-8-sig"), path)
        except UnicodeDecodeError:
            raise InputError(f"{path} is no glTF: its JSON is no text; export it again") from None
        if not isinstance(content, dict) or not isinstance(content.get("asset"), dict):
            raise InputError(f"{path} is no glTF: it lacks 'asset'; export it again")
        needed = content.get("extensionsRequired", [])
        extra = (
            [e for e in needed if str(e) not in _KNOWN] if isinstance(needed, list) else [needed]
        )
        if extra:
            raise InputError(f"{path} needs {short(extra[0])}: export it without compression")
        return cls(path, content, buffers)

    def items(self, kind: str) -> list[dict[str, Any]]:
        """All objects of a kind, such as "nodes". Raises InputError where they are no list of
        objects.
        """
        items = self.content.get(kind, [])
        if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
            raise self.damaged(f"{kind} is no list of objects")
        return items

    def item(self, kind: str, number: object) -> dict[str, Any]:
        """One object of a kind. Raises InputError where it does not exist."""
        items = self.items(kind)
        if type(number) is not int or not 0 <= number < len(items):
            raise self.damaged(f"it names {kind} {short(number)} of {len(items)}")
        return items[number]

    def array(self, number: object, types: tuple[str, ...]) -> NDArray[Any]:
        """Array of an accessor, of one of these types; normalised integers become float32. Raises
        InputError where the accessor is damaged, sparse, or of another type.
        """
        accessor = self.item("accessors", number)
        code, kind = accessor.get("componentType"), accessor.get("type")
        if kind not in types or type(code) is not int or code not in _COMPONENTS:
            raise self.damaged(f"accessor {number} has type {short(kind)}, not {'/'.join(types)}")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise InputError(f"{self.path} has sparse accessors: export it without them")
        view = self.item("bufferViews", accessor["bufferView"])
        dtype, shape = np.dtype(_COMPONENTS[code]), _SIZES[kind]
        row = dtype.itemsize * int(np.prod(shape, dtype=int))
        count, stride = accessor.get("count"), view.get("byteStride", row)
        starts = [holder.get("byteOffset", 0) for holder in (view, accessor)]
        length = view.get("byteLength", -1)
        if not all(type(n) is int and 0 <= n <= _LARGEST for n in (count, stride, length, *starts)):
            raise self.damaged(f"accessor {number} has a count or an offset that cannot be")
        buffer = self._buffer(view.get("buffer"))
        end = starts[0] + min(length, len(buffer))
        if (
            not count
            or stride < row
            or sum(starts) + (count - 1) * stride + row > min(end, len(buffer))
        ):
            raise self.damaged(f"accessor {number} reaches beyond its buffer")
        steps = tuple(np.cumprod([dtype.itemsize, *shape[::-1][:-1]])[::-1]) if shape else ()
        array = np.ndarray((count, *shape), dtype, buffer, sum(starts), (stride, *steps)).copy()
        if accessor.get("normalized") is True and dtype.kind in "iu":
            return np.maximum(array.astype(np.float32) / np.iinfo(dtype).max, -1)
        return array

    def damaged(self, what: str) -> InputError:
        """The error of a document that holds what cannot be."""
        return InputError(f"{self.path} is damaged ({what}): export it again")

    def _buffer(self, number: object) -> bytes:
        about = self.item("buffers", number)
        assert isinstance(number, int)
        if number not in self.buffers:
            self.buffers[number] = self._read_buffer(about.get("uri"))
        return self.buffers[number]

    def _read_buffer(self, uri: object) -> bytes:
        if not isinstance(uri, str):
            raise self.damaged("a buffer has no content")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise self.damaged("a buffer is no base64") from None
        place = Path(uri)
        if place.is_absolute() or ".." in place.parts or ":" in uri or not uri.isprintable():
            raise InputError(
                f"{self.path} keeps its data at {short(uri)}: put the file beside it, or export as"
                " .glb"
            )
        return load_bytes(self.path.parent / place, _LARGEST)


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB."""
    chunks: dict[int, bytes] = {}
    offset = 12
    while offset + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + length > len(data):
            raise InputError(f"{path} is cut off: export it again")
        chunks.setdefault(kind, data[offset + 8 : offset + 8 + length])
        offset += 8 + length
    if len(data) < 12 or struct.unpack_from("<I", data, 4)[0] != 2 or _JSON not in chunks:
        raise InputError(f"{path} is no GLB of version 2: export it again")
    return chunks[_JSON], chunks.get(_BIN)
