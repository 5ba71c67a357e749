"""Pose library in one file, a safetensors container, whose content is never executed.

The arrays are read through a memory map: a library of any size opens at once and takes no more
memory than the parts that are used. The metadata hold checksums of all arrays and of themselves.
"""

import errno
import json
import mmap
import re
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import save_file

from calib.errors import InputError
from calib.storage.atomic import replacing
from silhouette_core.body.body_arrays import body_arrays, body_from_arrays, with_prefix
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes, check_shape
from silhouette_core.image.spans import Rectangle, Spans
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.tree.library_check import check_library, check_library_settings
from silhouette_core.monocular.tree.pose_library import (
    BasePoses,
    Level,
    LibrarySettings,
    PoseLibrary,
)

VERSION = 4
_BODY = "body."
_FORMAT = "voxelpose pose library"
_TYPES = {
    "BOOL": np.bool_,
    "U8": np.uint8,
    "I16": np.int16,
    "U16": np.uint16,
    "I32": np.int32,
    "I64": np.int64,
    "F32": np.float32,
    "F64": np.float64,
}
_BASES = "angles", "quaternion", "source", "mirrored"
_PLAIN = (
    "views sample_base sample_view pelvis_px areas occluded cut leaf_offsets leaf_samples".split()
)
_LARGEST_HEADER = 10_000_000
_AGAIN = "build the library again (voxelpose library build)"
_UNFIT = KeyError, TypeError, ValueError, AttributeError, OverflowError, IndexError, RecursionError
_MARKED = 100_000  # the format's name stands within so many bytes


def write_library(library: PoseLibrary, path: Path) -> None:
    """Writes a library atomically."""
    bases, person = library.bases, library.model.person
    arrays = {f"base_{name}": getattr(bases, name) for name in _BASES}
    arrays |= {name: getattr(library, name) for name in _PLAIN}
    arrays |= {"sigma_rad": bases.sigma_rad, "body_shape": library.model.shape}
    body: dict[str, object] = {} if person is None else {"sizes": asdict(person)}
    if person is None:
        given, body["tree"] = body_arrays(library.model)
        arrays |= {_BODY + name: array for name, array in given.items()}
    for number, level in enumerate(library.levels):
        nodes = {"representative": level.representative, "parent": level.parent}
        nodes |= vars(level.spans)
        arrays |= {f"level{number}.{name}": array for name, array in nodes.items()}
    arrays |= {f"neighbours.{name}": array for name, array in library.neighbours.items()}
    if library.proposal is not None:
        arrays |= {f"proposal.{name}": array for name, array in library.proposal.arrays().items()}
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    about = {
        **body,
        "angles": list(library.model.tree.dof_names),
        "parts": list(library.model.names),
        "settings": asdict(library.settings),
        "clips": list(bases.clips),
        "levels": [
            {"size_px": level.size_px, "threshold": level.threshold} for level in library.levels
        ],
        "root_sigma_rad": bases.root_sigma_rad,
        "bounds_px": library.bounds_px,
        "checksums": {
            name: zlib.crc32(array.data.cast("B") if array.size else b"")
            for name, array in arrays.items()
        },
    }
    text = json.dumps(about)
    metadata = {
        "format": _FORMAT,
        "version": str(VERSION),
        "about": text,
        "about_checksum": str(zlib.crc32(text.encode())),
    }
    with replacing(path) as partial:
        try:
            save_file(arrays, partial, metadata)
        except SafetensorError as error:  # the system's error, as text
            number = re.search(r"os error (\d+)", str(error))
            raise OSError(int(number[1]) if number else errno.EIO, str(error)) from error


def is_library(path: Path) -> bool:
    """Whether a file is a pose library, of any version and possibly damaged."""
    try:
        with path.open("rb") as file:
            return _FORMAT.encode() in file.read(_MARKED)
    except OSError:
        return False


def read_library(path: Path) -> PoseLibrary:
    """Library of a file. Raises InputError where there is none, it is damaged or truncated, of
    another version, or empty.

    Returns:
        The library; its arrays are views into the file and cannot be written to.
    """
    arrays, about = _read(path)
    try:
        library = _library(arrays, about)
        empty = not len(library) or not library.levels
        if not empty:
            check_library(library)
    except (*_UNFIT, InputError) as error:
        raise InputError(f"{path} is damaged ({_reason(error)}): {_AGAIN}") from error
    if empty:
        raise InputError(f"{path} holds no poses: build the library again from more motion")
    return library


def _library(arrays: dict[str, NDArray], about: dict) -> PoseLibrary:
    """Library from the arrays and the description in its file."""
    # Files made before state more settings, of which there is no choice any more, or no thresholds;
    # their trees are by XOR.
    settings: dict[str, Any] = {"weighting": "xor"} | {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in about["settings"].items()
        if name in LibrarySettings.__dataclass_fields__ and value is not None
    }
    model = _body(arrays, about)
    if about["angles"] != list(model.tree.dof_names) or about["parts"] != list(model.names):
        raise ValueError("made with a body that has other joints")
    levels = []
    for number, facts in enumerate(about["levels"]):
        nodes = with_prefix(arrays, f"level{number}.")
        representative, parent = nodes["representative"], nodes["parent"]
        spans = Spans(nodes["rows"], nodes["starts"], nodes["ends"], nodes["offsets"])
        if len(spans) != len(representative):
            raise ValueError(
                f"level {number + 1} has {len(representative)} nodes and {len(spans)} silhouettes"
            )
        levels.append(
            Level(representative, parent, spans, tuple(facts["size_px"]), facts["threshold"])
        )
    if not all(isinstance(clip, str) for clip in about["clips"]):
        raise ValueError("its clips are no names")
    made_with = LibrarySettings(**settings)
    check_library_settings(made_with)
    learned = with_prefix(arrays, "proposal.")
    return PoseLibrary(
        model=model,
        settings=made_with,
        bases=BasePoses(
            **{name: arrays[f"base_{name}"] for name in _BASES},
            clips=tuple(about["clips"]),
            sigma_rad=arrays["sigma_rad"],
            root_sigma_rad=float(about["root_sigma_rad"]),
            spacing_m=0.0,
            frames=0,
        ),
        levels=tuple(levels),
        bounds_px=Rectangle(int(edge) for edge in about["bounds_px"]),
        neighbours=with_prefix(arrays, "neighbours."),
        proposal=PoseProposal.from_arrays(learned) if learned else None,
        **{name: arrays[name] for name in _PLAIN},
    )


def _body(arrays: dict[str, NDArray], about: dict) -> BodyModel:
    """The body: as given, or made from a person's measurements."""
    if "tree" in about:
        return body_from_arrays(with_prefix(arrays, _BODY), about["tree"])
    check_shape(arrays["body_shape"])
    return BodyModel.from_sizes(BodySizes(**about["sizes"])).reshaped(arrays["body_shape"])


def _loaded(text: str | bytes) -> Any:
    """Content of JSON."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("its description is nested too deeply") from None


def _reason(error: Exception) -> str:
    """What an error says, in a few words."""
    text = " ".join(str(error).split())
    text = f"no entry {text}" if isinstance(error, KeyError) else text
    return text if len(text) <= 300 else f"{text[:300]}..."


def _read(path: Path) -> tuple[dict[str, NDArray], dict]:
    """Arrays of a file, memory-mapped, and its description; both are checked completely."""
    try:
        with path.open("rb") as file:
            # A copy, of no page until it is written: numba compiles kernels anew for arrays that
            # cannot be written.
            content = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY))
    except (OSError, ValueError) as error:
        reason = (
            "the file is empty"
            if isinstance(error, ValueError)
            else getattr(error, "strerror", None) or error
        )
        raise InputError(f"the library {path} cannot be read: {reason}") from error
    length = int.from_bytes(content[:8], "little")
    try:
        if not 2 <= length <= min(_LARGEST_HEADER, len(content) - 8):
            raise ValueError("no header")
        header = _loaded(bytes(content[8 : 8 + length]))
        metadata = header.pop("__metadata__")
        if metadata["format"] != _FORMAT:
            raise ValueError("another format")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} is not a pose library, or is damaged: {_AGAIN}") from error
    if metadata.get("version") != str(VERSION):
        stated = " ".join(str(metadata.get("version"))[:20].split())
        raise InputError(
            f"{path} is a library of version {stated}, and this program reads version {VERSION}:"
            f" {_AGAIN}"
        )
    try:
        if str(zlib.crc32(metadata["about"].encode())) != metadata["about_checksum"]:
            raise ValueError("its description changed")
        about = _loaded(metadata["about"])
        body, arrays = content[8 + length :], {}
        for name, entry in header.items():
            first, last = entry["data_offsets"]
            if not 0 <= first <= last <= len(body):
                raise ValueError("it is truncated")
            if zlib.crc32(body[first:last]) != about["checksums"][name]:
                raise ValueError(f"its array {name} changed")
            shape = entry["shape"]
            if not all(type(count) is int and count >= 0 for count in shape):
                raise ValueError(f"its array {name} has the shape {shape}")
            dtype = _TYPES[entry["dtype"]]
            arrays[name] = np.frombuffer(body[first:last], dtype).reshape(shape)
        if arrays.keys() != about["checksums"].keys():
            raise ValueError("an array is missing")
    except (ValueError, KeyError, TypeError, AttributeError, SafetensorError) as error:
        raise InputError(f"{path} is damaged ({_reason(error)}): {_AGAIN}") from error
    return arrays, about
