"""A synchronised clip of several cameras as a recipe reads it, and functions that recipes share.

A recipe reads a data set into a `Clip`; `write.py` writes the clip as a recording folder. Recipes
import the project's own functions from here.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.camera import Camera, Rig  # noqa: F401
from calib.files import read_rig, write_rig  # noqa: F401
from calib.storage.atomic import FolderWriter  # noqa: F401
from calib.storage.documents import visible_entries
from voxelpose import InputError, Recording  # noqa: F401
from voxelpose.recording import mask_labels
from voxelpose.recording.camera_files import pictures_by_camera  # noqa: F401
from voxelpose.recording.frame_reader import STILLS, VIDEOS, FrameReader
from voxelpose.recording.image_names import natural_order  # noqa: F401
from voxelpose.recording.timestamps import write_timestamps  # noqa: F401

FloatArray = NDArray[np.float64]

# Rows: the new x, y and z axes in the old ones; the axis that points up in the data set becomes z.
_Z_UP_FROM = {
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, -1, 0], [0, 0, 1], [-1, 0, 0]],
}
UP_AXES = tuple(_Z_UP_FROM)


@dataclass(frozen=True)
class CameraView:
    """Camera, frames and masks of one camera of a clip.

    Attributes:
        camera: in metres, in a world whose z axis points up.
        frames: video or images; None where the data set has only masks.
        start: the file's frame that is frame 0 of the clip, where the files begin at different
            times. Frame 0 is the first time that all cameras recorded, so one camera has start 0.
        masks: silhouettes of the same frames, white where the person is.
        background: frames of the empty scene.
    """

    camera: Camera
    frames: FrameReader | None
    start: int = 0
    masks: FrameReader | None = None
    background: FrameReader | None = None


@dataclass(frozen=True, eq=False)
class Clip:
    """A synchronised clip of several cameras.

    Attributes:
        views: one per camera.
        fps: frames per second; None where the videos state it.
        truth: (T, 15, 3) float64, m, world with z up, joints in the order of `truth.JOINTS`; NaN
            where unknown; None where the data set has none. Row 0 belongs to frame 0 of the clip.
        approximate: joints of `truth` that the data set does not have and that were constructed.
        notes: which part of the data set it is, for the calibration's [metadata].
    """

    views: tuple[CameraView, ...]
    fps: float | None = None
    truth: FloatArray | None = None
    approximate: tuple[str, ...] = ()
    notes: dict[str, str] = field(default_factory=dict)


def z_up_from(up: str) -> FloatArray:
    """Returns the rotation, (3, 3), from a world whose `up` axis points up to one with z up."""
    return np.array(_Z_UP_FROM[up], dtype=np.float64)


def to_world_z_up(camera: Camera, up: str, unit_m: float = 1.0, name: str | None = None) -> Camera:
    """Returns the camera in a world in metres whose z axis points up.

    Args:
        camera: its translation in the data set's unit, its rotation from the data set's world.
        up: the axis that points up in the data set's world, one of `UP_AXES`.
        unit_m: the data set's unit, m.
        name: new name; None keeps the camera's own.
    """
    return replace(
        camera,
        name=name or camera.name,
        rotation=camera.rotation @ z_up_from(up).T,
        translation=unit_m * camera.translation,
    )


def make_camera(
    source: object,
    *,
    name: str,
    size: Sequence[float],
    matrix: ArrayLike,
    distortion: ArrayLike,
    rotation: ArrayLike,
    translation: ArrayLike,
    fisheye: bool = False,
) -> Camera:
    """Returns a camera; its rotation is orthonormalised, because files round it.

    Args:
        source: the file it is read from, for messages.
        name: name of the camera.
        size: (width, height), px.
        matrix: (3, 3), px.
        distortion: (n,), in OpenCV's order.
        rotation: (3, 3), camera from world, or a Rodrigues vector (3,), rad.
        translation: (3,), camera from world.
        fisheye: whether the distortion is OpenCV's fisheye model.

    Raises:
        InputError: a value has the wrong shape or is impossible.
    """
    try:
        matrix_3x3 = np.asarray(rotation, dtype=np.float64)
        if matrix_3x3.size == 3:
            matrix_3x3 = cv2.Rodrigues(matrix_3x3.reshape(3, 1))[0]
        u, singular_values, vt = np.linalg.svd(matrix_3x3.reshape(3, 3))
        if np.abs(singular_values - 1).max() > 0.01 or np.linalg.det(u @ vt) < 0:
            raise ValueError(f"camera {name}: rotation is no rotation: {matrix_3x3.tolist()}")
        return Camera(
            name,
            (round(size[0]), round(size[1])),
            np.asarray(matrix, dtype=np.float64).reshape(3, 3),
            np.asarray(distortion, dtype=np.float64).reshape(-1),
            u @ vt,
            np.asarray(translation, dtype=np.float64).reshape(3),
            fisheye,
        )
    except (ValueError, TypeError, IndexError, np.linalg.LinAlgError) as error:
        raise InputError(f"{source}: {error}: download the calibration again") from None


def read_json_cameras(
    file: Path,
    kind: str,
    keys: Mapping[str, str],
    entries: Callable[[object], Iterable[Mapping]] = iter,
) -> dict[str, Camera]:
    """Returns the cameras of a JSON file by the data set's own names.

    Args:
        file: JSON file with an object per camera, which has a "name".
        kind: what the file should be, for messages.
        keys: the file's key of each argument of `make_camera`.
        entries: returns the cameras' objects from the file's content.

    Raises:
        InputError: the file is missing, is no JSON, or lacks a key.
    """
    content = read_json(file)
    try:
        return {
            entry["name"]: make_camera(
                file,
                name=camera_name(entry["name"]),
                **{argument: entry[key] for argument, key in keys.items()},
            )
            for entry in entries(content)
        }
    except (KeyError, TypeError) as error:
        raise InputError(f"{file} is no {kind} ({error} is missing)") from None


def camera_name(own: str) -> str:
    """Returns the name of a camera in the recording: the data set's own name after cam_."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", own).strip("_")
    return name if name.lower().startswith("cam") else f"cam_{name}"


def select_names(
    available: Iterable[str], selected: Sequence[str] | None, kind: str, place: object
) -> list[str]:
    """Returns the available names that are selected, in their order; None selects all.

    Args:
        available: names in the data set.
        selected: names that the user gave.
        kind: what is named, for messages.
        place: file or folder that has the names, for messages.

    Raises:
        InputError: nothing is available, or a selected name is not.
    """
    names = list(available)
    if not names:
        raise InputError(f"{place} holds no {kind}: give the folder that the card describes")
    missing = [name for name in selected or () if name not in names]
    if missing:
        listed = ", ".join(names[:40]) + (" ..." if len(names) > 40 else "")
        raise InputError(f"there is no {kind} {missing[0]!r} in {place}: it has {listed}")
    return names if selected is None else [name for name in names if name in selected]


def first_existing(folder: Path, *relative: str) -> Path:
    """Returns the first of several files or folders that exists.

    Raises:
        InputError: none exists.
    """
    for name in relative:
        if (folder / name).exists():
            return folder / name
    raise InputError(
        f"{folder / relative[0]} is missing: download it, or correct the source folder"
    )


def find_frames(path: Path) -> Path | None:
    """Returns the video, image or folder of images at a path without suffix; None if none is."""
    if path.is_dir():
        return (
            path if any(file.suffix.lower() in STILLS for file in visible_entries(path)) else None
        )
    if path.is_file():
        return path if path.suffix.lower() in VIDEOS | STILLS else None
    siblings = visible_entries(path.parent)
    return next(
        (
            file
            for file in siblings
            if file.stem == path.name and file.suffix.lower() in VIDEOS | STILLS
        ),
        None,
    )


def open_frames(path: Path) -> FrameReader:
    """Returns a reader of a video, an image or a folder of images.

    Raises:
        InputError: it is missing, empty or cannot be read.
    """
    try:
        return FrameReader.open(path)
    except InputError as error:
        raise InputError(f"{error}; repeat the download if it was interrupted") from None


def open_masks(paths: Mapping[str, Path | None], label: str | None) -> dict[str, FrameReader]:
    """Returns readers of silhouettes by camera name, of the cameras that have masks.

    Args:
        paths: videos or folders of images of masks; None where there is none.
        label: labels of the person; None: found.

    Raises:
        InputError: one cannot be read, or does not say by itself who is the person.
    """
    there = {name: path for name, path in paths.items() if path is not None}
    try:
        return dict(mask_labels.open_masks(there, label)[0])
    except InputError as error:
        raise InputError(f"{error}; repeat the download if it was interrupted") from None


def read_text(file: Path) -> str:
    """Returns a text file's content.

    Raises:
        InputError: it is missing, or no text.
    """
    try:
        return file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{file} is missing: download it, or correct the source folder") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read as text: {error}: download it again") from None


def read_json(file: Path) -> object:
    """Returns a JSON file's content.

    Raises:
        InputError: it is missing or no JSON.
    """
    try:
        return json.loads(read_text(file))
    except json.JSONDecodeError as error:
        raise InputError(f"{file} is not whole JSON ({error}): download it again") from None


def read_numbers(
    words: Iterable[str], file: Path, name: str, count: int | None = None
) -> FloatArray:
    """Returns words as finite float64 numbers.

    Args:
        words: the numbers as text.
        file: the file they are read from, for messages.
        name: what they are, for messages.
        count: required number of numbers; None allows any.

    Raises:
        InputError: one is no number, or there are too many or too few.
    """
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{file}: {name} cannot be read ({error}): download it again") from None
    if (count is not None and len(numbers) != count) or not np.isfinite(numbers).all():
        raise InputError(
            f"{file}: {name} must be {count or 'finite'} numbers, got {len(numbers)}: "
            "download it again"
        )
    return numbers


def number_in(name: str) -> int | None:
    """Returns the last whole number in a name; None where it has none."""
    numbers = re.findall(r"\d+", name)
    return int(numbers[-1]) if numbers else None
