"""Motion files: safetensors, whose content is never executed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from calib.errors import InputError
from calib.upright import Z_UP
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.motion import Motion

MOTION = "motion.safetensors"
_FORMAT = "voxelpose motion 1"
_QUALITY = "quality."


def write_motion(motion: Motion, path: Path) -> None:
    """Writes a motion.

    Arrays have the names of the attributes, those of the quality `quality.NAME`; the metadata hold
    the measurements of the body.

    Args:
        motion: the motion.
        path: the file, usually motion.safetensors.
    """
    arrays = {
        "root_m": motion.root_m,
        "root_quaternion": motion.root_quaternion,
        "angles_rad": motion.angles_rad,
        "frames": motion.frames,
        "time_s": motion.time_s,
        "body_shape": motion.model.shape,
        "up": motion.up,
        **{_QUALITY + name: array for name, array in motion.quality.items()},
    }
    sizes = motion.model.sizes
    metadata = {
        "format": _FORMAT,
        "fps": repr(motion.fps),
        "stature_m": repr(sizes.stature_m),
        "chest_girth_m": "" if sizes.chest_girth_m is None else repr(sizes.chest_girth_m),
        "sex": sizes.sex,
        "floor_m": repr(motion.floor_m),
        "parts": json.dumps(motion.model.names),
        "angles": json.dumps(motion.model.dof_names),
    }
    # Written by Python and not by safetensors, so that a full disk raises OSError.
    data = save({name: np.ascontiguousarray(array) for name, array in arrays.items()}, metadata)
    path.write_bytes(_with_ordered_metadata(data))


def _with_ordered_metadata(data: bytes) -> bytes:
    """The same file with its metadata in order, which safetensors leaves to chance: equal motions
    make equal files.
    """
    start = 8 + int.from_bytes(data[:8], "little")
    header = json.loads(data[8:start])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    assert len(text) <= start - 8, "the header must fit where it was"
    return data[:8] + text.ljust(start - 8) + data[start:]


def read_motion(path: Path) -> Motion:
    """Motion of a file written by `write_motion`.

    Args:
        path: the file.

    Returns:
        The motion, its body made from the measurements.

    Raises:
        InputError: the file is missing, damaged, or of another kind.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            about = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path} cannot be read as a motion: {error}") from error
    if about.get("format") != _FORMAT:
        raise InputError(
            f"{path} is no motion of this version (format {about.get('format')!r}, wanted"
            f" {_FORMAT!r}): fit again"
        )
    chest = about["chest_girth_m"]
    sizes = BodySizes(float(about["stature_m"]), float(chest) if chest else None, about["sex"])
    model = BodyModel.from_sizes(sizes).reshaped(arrays["body_shape"])
    if json.loads(about["angles"]) != list(model.dof_names):
        raise InputError(f"{path} was made with a body that has other joint angles: fit again")
    return Motion(
        fps=float(about["fps"]),
        model=model,
        root_m=arrays["root_m"],
        root_quaternion=arrays["root_quaternion"],
        angles_rad=arrays["angles_rad"],
        frames=arrays["frames"],
        time_s=arrays["time_s"],
        quality={
            name.removeprefix(_QUALITY): array
            for name, array in arrays.items()
            if name.startswith(_QUALITY)
        },
        up=arrays.get("up", Z_UP),  # earlier files have z up
        floor_m=float(about.get("floor_m", 0.0)),
    )


def body_of_motion(path: Path) -> BodyModel:
    """Body of a motion file, or of a result folder that holds one.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    file = path / MOTION if path.is_dir() else path
    if not file.is_file():
        raise InputError(
            f"{path} holds no body: give the folder of an earlier result of the same person"
        )
    return read_motion(file).model
