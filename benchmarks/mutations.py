"""Mutations of files: text, JSON, bytes, and the arrays of a safetensors file."""

import json
import re
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

Mutation = Callable[[bytes, Random], bytes]

NUMBERS = [
    *("0", "-1", "1", "2", "-0.0", "1e308", "-1e308", "1e-308", "nan", "NaN", "inf", "-inf"),
    *(".Nan", "2147483648", "-2147483649", "4294967296", "18446744073709551616", "1e9", "100000"),
    *("1e300", "65536", "0x41", "1_000", "٣", "²", "9" * 400, "9" * 5000, "0." + "9" * 5000),
]
TYPES = ['"x"', "''", "null", "true", "[]", "{}", "[[]]", '[1, "a", null]', '{"a": 1}', "~", "-"]
_VALUES: list[Any] = [
    *(0, -1, 1, 2.5, 1e308, -1e308, 1e300, 2**31, 2**63, 10**400, float("nan"), float("inf")),
    *(None, True, "", "x", "x" * 5000, "../..", "\x00", "é\n\t\"'<b>", [], {}, [[]], [None] * 3),
    *({"a": 1}, ["a"] * 20, [1e308] * 9, [[[[1]]]]),
]
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9-]*")
_TEXTS = frozenset("toml txt yml xml bvh trc xcp urdf obj dae target".split())


def mutated(data: bytes, mutation: Mutation, rng: Random) -> bytes:
    """Bytes after one to four mutations."""
    for _ in range(rng.choice((1, 1, 1, 1, 2, 4))):
        try:
            data = mutation(data, rng)
        except (TypeError, ValueError, KeyError, AttributeError, OverflowError, RecursionError):
            data = any_bytes(data, rng)  # an earlier mutation left nothing to change in that way
    return data


def any_bytes(data: bytes, rng: Random) -> bytes:
    """Flipped bits, cut, doubled, random or missing bytes."""
    if not data:
        return rng.randbytes(20)
    place = rng.randrange(len(data))
    end = min(len(data), place + rng.choice((1, 4, 64, 1024)))
    match rng.randrange(8):
        case 0 | 1:
            flipped = bytearray(data)
            for _ in range(rng.choice((1, 1, 8))):
                flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            return bytes(flipped)
        case 2:
            return data[:place]
        case 3:
            return data + data
        case 4:
            return data[:place] + rng.randbytes(end - place) + data[end:]
        case 5:
            return data[:place] + data[end:]
        case 6:
            return data[:end] + data[place:end] * rng.choice((1, 50)) + data[end:]
        case _:
            return data[:place] + bytes([rng.choice((0, 0xFF, 0x7F, 0x80))]) + data[place + 1 :]


def any_text(data: bytes, rng: Random) -> bytes:
    """Other numbers and words, lines that are missing or twice, quotes, deep nesting."""
    choice = rng.randrange(12)
    if choice < 5:
        new = rng.choice(NUMBERS if choice < 4 else TYPES)
        return _replaced(data, _NUMBER, new.encode(), rng)
    if choice == 5:
        words = _WORD.findall(data) or [b"a"]
        return _replaced(data, _WORD, rng.choice([*words, b"", b"x" * 3000]), rng)
    if choice < 8:
        lines = data.splitlines(keepends=True) or [b""]
        first = rng.randrange(len(lines))
        last = min(len(lines), first + rng.choice((1, 1, 1, 5, 40)))
        kept = [lines[first:last] * rng.choice((0, 0, 2, 20)), [], lines[first:last][::-1]]
        return b"".join(lines[:first] + kept[rng.randrange(3)] + lines[last:])
    if choice == 8:
        depth = rng.choice((5, 60, 1000, 20_000))
        around = rng.choice(((b"[", b"]"), (b'{"a":', b"}"), (b"<_>", b"</_>"), (b"(", b")")))
        number = around[0] * depth + b"1" + around[1] * rng.choice((depth, 0))
        return _replaced(data, _NUMBER, number, rng)
    if choice == 9:
        place = rng.randrange(len(data) + 1)
        stray = (b'"', b"'", b"\n", b",", b"\t", b"\x00", b"\xff\xfe", b"&a ", b"*a", b"#", b"}")
        return data[:place] + rng.choice(stray) + data[place:]
    return any_bytes(data, rng)


def any_json(data: bytes, rng: Random) -> bytes:
    """Other values, missing and doubled entries at a random place, or a mutation of its text."""
    if rng.random() < 0.3:
        return any_text(data, rng)
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return any_text(data, rng)
    return json.dumps(_changed(content, rng)).encode()


def any_table(data: bytes, rng: Random) -> bytes:
    """As `any_text`, and columns that are missing, and stray quotes before much text."""
    if rng.random() > 0.1:
        return any_text(data, rng)
    if rng.random() < 0.5:
        return data + b'"' + b"1,2,3\n" * rng.choice((10, 40_000))
    column = rng.randrange(4)
    rows = [line.split(b",") for line in data.splitlines()]
    return b"\n".join(b",".join(row[:column] + row[column + 1 :]) for row in rows)


def any_arrays(data: bytes, rng: Random) -> bytes:
    """Other numbers, shapes and types of a safetensors file's arrays, other metadata, or bytes."""
    if rng.random() < 0.15:
        return any_bytes(data, rng)
    try:
        header, body = _split(data)
    except (ValueError, RecursionError):
        return any_bytes(data, rng)
    if rng.random() < 0.15:
        return _joined(_changed(header, rng), body)
    about = header.get("__metadata__")
    if isinstance(about, dict) and rng.random() < 0.3:
        key = rng.choice(sorted(about))
        text = str(about[key]).encode()
        mutation = any_json if text[:1] in b"{[" else any_text
        about[key] = mutated(text, mutation, rng).decode("utf-8", "replace")
        return _joined(header, body)
    arrays = [name for name in header if name != "__metadata__"]
    if not arrays:
        return any_bytes(data, rng)
    return _with_other_array(header, body, rng.choice(arrays), rng)


def mutation_of(path: str) -> Mutation:
    """How a file of a name is mutated."""
    match path.rpartition(".")[2]:
        case "json" | "gltf":
            return any_json
        case "csv":
            return any_table
        case "safetensors":
            return any_arrays
        case "vplib":
            return any_library
        case suffix if suffix in _TEXTS:
            return any_text
    return any_bytes


def any_library(data: bytes, rng: Random) -> bytes:
    """As `any_arrays`, with checksums that are right again."""
    return with_checksums(any_arrays(data, rng))


def with_checksums(data: bytes) -> bytes:
    """A pose library with right checksums of whatever it holds, as far as they can be made."""
    try:
        header, body = _split(data)
        metadata = header["__metadata__"]
        about = json.loads(metadata["about"])
        about["checksums"] = {
            name: zlib.crc32(body[slice(*entry["data_offsets"])])
            for name, entry in header.items()
            if name != "__metadata__"
        }
        metadata["about"] = json.dumps(about)
        metadata["about_checksum"] = str(zlib.crc32(metadata["about"].encode()))
        return _joined(header, body)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return data


def _replaced(data: bytes, what: re.Pattern[bytes], new: bytes, rng: Random) -> bytes:
    found = list(what.finditer(data))
    if not found:
        return data + new
    place = rng.choice(found)
    return data[: place.start()] + new + data[place.end() :]


def _changed(content: Any, rng: Random) -> Any:
    """The same JSON with another value, without an entry, or with one twice, at a random place."""
    places: list[tuple[Any, Any]] = []
    queue = [content]
    for outer in queue:
        keys = outer.keys() if isinstance(outer, dict) else range(len(outer))
        # Few of the many entries of a long list, so that what stands alone is reached, too.
        keys = list(keys) if len(keys) < 20 else rng.sample(list(keys), 20)
        places += [(outer, key) for key in keys]
        queue += [outer[key] for key in keys if isinstance(outer[key], dict | list)]
    if not places:
        return rng.choice(_VALUES)
    outer, key = rng.choice(places)
    match rng.randrange(6):
        case 0:
            del outer[key]
        case 1 if isinstance(outer, list):
            outer.insert(key, outer[key])
        case 2:
            outer[key] = rng.choice(places)[0] if rng.random() < 0.2 else [outer[key]]
            outer[key] = json.loads(json.dumps(outer[key])) if outer[key] is not outer else None
        case 3 if isinstance(outer[key], int | float):
            outer[key] = outer[key] * rng.choice((-1, 10, 1e6, 1e-6, 0))
        case _:
            outer[key] = rng.choice(_VALUES)
    return content


def _split(data: bytes) -> tuple[dict[str, Any], bytes]:
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    if not isinstance(header, dict):
        raise ValueError("no header")
    return header, data[8 + length :]


def _joined(header: Any, body: bytes) -> bytes:
    text = json.dumps(header).encode()
    text = text.ljust(-(-len(text) // 8) * 8)
    return len(text).to_bytes(8, "little") + text + body


def _with_other_array(header: dict[str, Any], body: bytes, chosen: str, rng: Random) -> bytes:
    """The file with one array of other numbers, another type or another length; a valid file."""
    kinds = {"BOOL": "?", "U8": "u1", "I16": "<i2", "U16": "<u2", "I32": "<i4", "I64": "<i8"}
    kinds |= {"F32": "<f4", "F64": "<f8"}
    new, parts, start = {}, [], 0
    for name, entry in header.items():
        if name == "__metadata__":
            new[name] = entry
            continue
        if not isinstance(entry, dict) or entry.get("dtype") not in kinds:
            return any_bytes(_joined(header, body), rng)
        content = body[slice(*entry["data_offsets"])]
        array = np.frombuffer(content, kinds[entry["dtype"]]).reshape(entry["shape"])
        if name == chosen:
            if rng.random() < 0.08:
                continue
            array = _other_array(array, rng)
        kind = next(key for key, text in kinds.items() if np.dtype(text) == array.dtype)
        content = np.ascontiguousarray(array).tobytes()
        offsets = [start, start + len(content)]
        new[name] = {"dtype": kind, "shape": list(array.shape), "data_offsets": offsets}
        start += len(content)
        parts.append(content)
    return _joined(new, b"".join(parts))


def _other_array(array: np.ndarray, rng: Random) -> np.ndarray:
    array = array.copy()
    match rng.randrange(9):
        case 0:
            return array[:-1] if array.ndim else array.reshape(1)
        case 1:
            return array.reshape(-1) if array.ndim > 1 else array[..., None]
        case 2:
            kinds = ["?", "u1", "<i2", "<u2", "<i4", "<i8", "<f4", "<f8"]
            with np.errstate(all="ignore"):
                return array.astype(rng.choice(kinds))
        case 3:
            return np.concatenate([array, array]) if array.ndim else array
        case 4:
            return array[:0] if array.ndim else array
        case 5 if array.ndim:
            return array[np.array(rng.sample(range(len(array)), len(array)), np.int64)]
        case _:
            flat = array.reshape(-1)
            with np.errstate(all="ignore"):
                for _ in range(rng.choice((1, 1, 5))):
                    if not len(flat):
                        break
                    extremes = (
                        [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e6, -1, 0]
                        if flat.dtype.kind == "f"
                        else [0, -1, 1, 2**15, 2**20, 2**31 - 1, 2**40, -(2**63)]
                    )
                    value = np.array(rng.choice(extremes)).astype(flat.dtype)
                    flat[rng.randrange(len(flat))] = value
            return flat.reshape(array.shape)
