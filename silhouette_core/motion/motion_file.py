"""Motion files: safetensors, whose content is never executed."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from calib.errors import InputError
from calib.upright import Z_UP
from silhouette_core.body.body_arrays import (
    BODY_TYPES,
    MOST_NAMES,
    MOST_ROWS,
    body_arrays,
    body_from_arrays,
    with_prefix,
)
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes, check_shape
from silhouette_core.motion.conditioning import Conditioning
from silhouette_core.motion.joint_files import FARTHEST_M
from silhouette_core.motion.motion import Motion

MOTION = "motion.safetensors"
_FORMAT = "voxelpose motion 3"
_QUALITY, _BODY, _UNFILTERED = "quality.", "body.", "unfiltered."
_POSES = "root_m", "root_quaternion", "angles_rad"
_TYPES = {
    "root_m": "F64",
    "root_quaternion": "F64",
    "angles_rad": "F64",
    "frames": "I64",
    "time_s": "F64",
    "body_shape": "F64",
    "up": "F64",
    "filled": "BOOL",
    **{_UNFILTERED + name: "F64" for name in _POSES},
}
_QUALITY_TYPES = ("F64", "F32", "BOOL", "I64", "I32", "U8")
_FLAT = (
    "unexplained outside outline_agreement right_probability pose_probability pose_error_mm".split()
)
_UNFIT = (
    *(KeyError, TypeError, ValueError, OverflowError, IndexError, RecursionError),
    msgspec.ValidationError,
)
# Half a day at 60 frames a second; a pose takes some 1,400 bytes.
_MOST_POSES = 12 * 3600 * 60
_LARGEST = 1500 * _MOST_POSES
_LARGEST_RAD = 50
_LATEST_S = 10**10
_LARGEST_QUALITY = 10**9
_SLOWEST_FPS, _FASTEST_FPS = 1 / 1000, 100_000
_UNIT_TOLERANCE = 1 / 100
_GAP_FRAMES, _GAP_RATE = 1000, 4


def write_motion(motion: Motion, path: Path) -> None:
    """Writes a motion, usually as motion.safetensors.

    Arrays have the names of the attributes, those of the quality `quality.NAME`. Poses before
    filter and filling are `unfiltered.NAME`, a row for each frame that was not filled; `filled` is
    left out where none was. The metadata hold the measurements of the body, and `conditioning` the
    settings of filter and filling. A body that is not made from a person's measurements is written
    itself: its arrays as `body.NAME`, its kinematic tree in the metadata.
    """
    arrays = {name: getattr(motion, name) for name in (*_POSES, "frames", "time_s", "up")}
    arrays |= {_QUALITY + name: array for name, array in motion.quality.items()}
    arrays["body_shape"] = motion.model.shape
    if motion.filled.any():
        arrays["filled"] = motion.filled
    if motion.unfiltered is not None:
        arrays |= {_UNFILTERED + name: getattr(motion.unfiltered, name) for name in _POSES}
    sizes = motion.model.person
    if sizes is None:
        given, tree = body_arrays(motion.model)
        arrays |= {_BODY + name: array for name, array in given.items()}
        about = {"tree": tree}
    else:
        chest = "" if sizes.chest_girth_m is None else repr(sizes.chest_girth_m)
        about = {
            "stature_m": repr(sizes.stature_m),
            "chest_girth_m": chest,
            "sex": sizes.sex,
            "template_changes": json.dumps(sizes.changes),
        }
    done = motion.conditioning
    if done is not None:
        about["conditioning"] = json.dumps(asdict(done))
    metadata = {
        "format": _FORMAT,
        "fps": repr(motion.fps),
        **about,
        "floor_m": repr(motion.floor_m),
        "parts": json.dumps(motion.model.names),
        "angles": json.dumps(motion.model.tree.dof_names),
    }
    # Written by Python and not by safetensors, so that a full disk raises OSError.
    data = save({name: np.ascontiguousarray(array) for name, array in arrays.items()}, metadata)
    path.write_bytes(_with_ordered_metadata(data))


def _with_ordered_metadata(data: bytes) -> bytes:
    """The same file, its metadata in order, not as chance has it: equal motions, equal files."""
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    assert len(text) <= start - 8, "the header must fit where it was"
    return data[:8] + text.ljust(start - 8) + data[start:]


def read_motion(path: Path) -> Motion:
    """Motion of a file written by `write_motion`, its body made from the measurements. Raises
    InputError where the file is missing, damaged, or of another kind.
    """
    try:
        size = path.stat().st_size
        if size > _LARGEST:
            raise InputError(
                f"{path} has {size / 1e9:.1f} GB, more than the motion of half a day: fit again, in"
                " several recordings"
            )
        with safe_open(str(path), framework="numpy") as file:
            about = file.metadata() or {}
            if about.get("format") != _FORMAT:
                raise InputError(
                    f"{path} is no motion of this version (format"
                    f" {str(about.get('format'))[:40]!r}, wanted {_FORMAT!r}): fit again"
                )
            arrays = _arrays(file)
    except (OSError, SafetensorError) as error:
        reason = " ".join(str(error).split())[:300]
        raise InputError(f"{path} cannot be read as a motion: {reason}; fit again") from error
    except _UNFIT as error:
        raise _damaged(path, error) from error
    try:
        motion = _motion(about, arrays)
        _check_values(motion)
    except (*_UNFIT, InputError) as error:
        raise _damaged(path, error) from error
    if json.loads(about["angles"]) != list(motion.model.tree.dof_names):
        raise InputError(f"{path} was made with a body that has other joint angles: fit again")
    return motion


def _damaged(path: Path, error: Exception) -> InputError:
    reason = f"no entry {error}" if isinstance(error, KeyError) else str(error)
    return InputError(f"{path} is damaged ({' '.join(reason.split())[:300]}): fit again")


def _arrays(file: Any) -> dict[str, NDArray[Any]]:
    """Arrays of an open file that belong to a motion, of shapes and dtypes checked before."""
    types = _TYPES | {_BODY + name: kind for name, kind in BODY_TYPES.items()}
    names = [name for name in file.keys() if name in types or name.startswith(_QUALITY)]  # noqa: SIM118 (not a dict)
    shapes = {name: tuple(file.get_slice(name).get_shape()) for name in names}
    count = shapes["root_m"][0] if shapes["root_m"] else 0
    if count > _MOST_POSES:
        raise ValueError(f"it holds {count:,} poses, more than the {_MOST_POSES:,} of half a day")
    for name in names:
        shape, kind = shapes[name], file.get_slice(name).get_dtype()
        if name.startswith(_QUALITY):
            if shape[:1] != (count,) or len(shape) > 2 or max(shape[1:], default=0) > MOST_NAMES:
                raise ValueError(f"{name} has the shape {shape} for {count} poses")
            if kind not in _QUALITY_TYPES:
                raise ValueError(f"{name} has the type {kind}")
        elif kind != types[name] or shape[1:] > (MOST_NAMES,):
            raise ValueError(f"{name} has the shape {shape} and type {kind}, not {types[name]}")
        elif name.startswith(_BODY) and shape[0] > MOST_ROWS:
            raise ValueError(f"{name} has {shape[0]:,} rows, more than {MOST_ROWS:,}")
    return {name: file.get_tensor(name) for name in names}


def _motion(about: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> Motion:
    """Motion of the metadata and arrays of a file."""
    if not isinstance(json.loads(about["angles"]), list):
        raise ValueError("its angles are no list of names")
    motion = Motion(
        fps=float(about["fps"]),
        model=_model(about, arrays),
        unfiltered=None,
        corrections=(),
        sampled_from=None,
        **{name: arrays[name] for name in (*_POSES, "frames", "time_s")},
        quality=with_prefix(arrays, _QUALITY),
        up=arrays.get("up", Z_UP),  # earlier files have z up
        floor_m=float(about.get("floor_m", 0.0)),
        filled=arrays.get("filled", np.zeros(0, bool)),
        conditioning=(  # None in files of earlier versions
            msgspec.convert(json.loads(about["conditioning"]), Conditioning)
            if "conditioning" in about
            else None
        ),
    )
    if _UNFILTERED + "root_m" not in arrays:
        return motion
    posed = motion.select(np.flatnonzero(~motion.filled))
    poses = {name: arrays[_UNFILTERED + name] for name in _POSES}
    unfiltered = replace(posed, **poses, quality={}, conditioning=None)
    return replace(motion, unfiltered=unfiltered)


def _model(about: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> BodyModel:
    """The body: as given, or made from a person's measurements."""
    if "tree" in about:
        return body_from_arrays(with_prefix(arrays, _BODY), about["tree"])
    chest, changes = about["chest_girth_m"], json.loads(about["template_changes"])
    if not isinstance(changes, list) or len(changes) != 4:
        raise ValueError("its template_changes are no four numbers")
    sizes = BodySizes(
        float(about["stature_m"]),
        float(chest) if chest else None,
        about["sex"],
        *(float(change) for change in changes),
    )
    check_shape(arrays["body_shape"])
    return BodyModel.from_sizes(sizes).reshaped(arrays["body_shape"])


def _check_values(motion: Motion) -> None:
    """Checks that numbers are such as a person and a recording have. Raises ValueError where one,
    which the message names, is not.
    """
    columns = {"part_overlap": len(motion.model.names), "part_unsupported": len(motion.model.names)}
    for name, array in motion.quality.items():
        joints = name.startswith(("joint_", "landmark_"))
        wanted = columns.get(name, len(motion.model.landmarks_m) if joints else None)
        flat = name in _FLAT
        if (wanted and array.shape[1:] != (wanted,)) or (flat and array.ndim != 1):
            raise ValueError(f"quality.{name} has the shape {array.shape}")
        if array.dtype.kind == "f" and (np.abs(array) > _LARGEST_QUALITY).any():
            raise ValueError(f"quality.{name} holds numbers beyond {_LARGEST_QUALITY:g}")
    if not _SLOWEST_FPS <= motion.fps <= _FASTEST_FPS:
        raise ValueError(f"fps is {motion.fps:g}")
    if not abs(motion.floor_m) <= FARTHEST_M:
        raise ValueError(f"floor_m is {motion.floor_m:g}")
    if not (np.abs(motion.up) < 2).all() or abs(np.linalg.norm(motion.up) - 1) > _UNIT_TOLERANCE:
        raise ValueError("up has not the length 1")
    if motion.unfiltered is not None:
        _check_values(motion.unfiltered)
    if not len(motion):
        return
    lengths = np.linalg.norm(np.clip(motion.root_quaternion, -2, 2), axis=1)
    if (np.abs(lengths - 1) > _UNIT_TOLERANCE).any():
        raise ValueError("root_quaternion has not the length 1")
    largest = {
        "root_m": FARTHEST_M,
        "angles_rad": _LARGEST_RAD,
        "time_s": _LATEST_S,
        "frames": _MOST_POSES * 10,
    }
    for name, most in largest.items():
        array = getattr(motion, name)
        if array.min(initial=0) < -most or array.max(initial=0) > most:
            raise ValueError(f"{name} holds numbers beyond {most:g}")
    if motion.frames[0] < 0 or (np.diff(motion.time_s) < 0).any():
        raise ValueError("frames and time_s must increase from 0")
    # Frames between the poses are filled in by some formats: a wrong number would fill memory.
    frames = int(motion.frames[-1] - motion.frames[0])
    if frames > _GAP_FRAMES + _GAP_RATE * max(len(motion), np.ptp(motion.time_s) * motion.fps):
        raise ValueError(f"frames are {frames:,} apart, time_s {np.ptp(motion.time_s):g} s")


def body_of_motion(path: Path) -> BodyModel:
    """Body of a motion file, or of a result folder that holds one. Raises InputError where there is
    none, or it cannot be read.
    """
    file = motion_path(path)
    if not file.is_file():
        raise InputError(
            f"{path} holds no body: give the folder of an earlier result of the same person"
        )
    return read_motion(file).model


def motion_path(path: Path) -> Path:
    """The motion file of a result folder; of anything else the path itself."""
    return path / MOTION if path.is_dir() else path
