"""Files that somebody sends into a project: where each belongs, and how it gets there whole."""

import asyncio
import os
import re
import shutil
from asyncio import StreamReader
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from calib.errors import InputError
from calib.storage.atomic import replacing, unwritable
from calib.storage.documents import LARGEST_CALIBRATION, load_text, parse_toml, visible_entries
from silhouette_core.body.presets import body_preset
from voxelpose.recording.camera_files import (
    CALIBRATION_SUFFIXES,
    SUBFOLDERS,
    is_image_folder,
    pictures_by_camera,
)
from voxelpose.recording.folder import calibration_path
from voxelpose.recording.frame_reader import STILLS, VIDEOS, FrameReader, read_still
from voxelpose.recording.subject import read_subject
from voxelpose.studio.projects import SINGLE_FILES, check_plain_name

Place = Literal[
    "video",
    "background",
    "masks",
    "boards",
    "board_walk",
    "calibration",
    "subject.toml",
    "timestamps.csv",
]
LARGEST_UPLOAD = 32 * 2**30
"""Bytes of a file: hours of a camera."""
_SPARED = 2**30  # bytes of the disk that stay free
_SILENT_S = 60  # without a piece, after which whoever sends is gone
_PIECE = 2**18
_IN_FOLDER = {"intri.yml", "extri.yml", "cameras.txt", "images.txt"}  # EasyMocap's, COLMAP's
# Where cameras' pictures lie in a project, and whether a loose picture is a camera's there.
_PICTURES: dict[Place, tuple[str, bool]] = {
    "video": ("", False),
    "background": ("background", True),
    "masks": ("masks", False),
    "boards": ("boards", False),
    "board_walk": ("board_walk", True),
}
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")


def target_of(project: Path, place: Place, name: str, size: int, camera: str = "") -> Path:
    """Where a file of so many bytes belongs; a picture in the folder of a camera, if one is named.
    InputError where it cannot be taken.
    """
    check_plain_name(name)
    suffix = Path(name).suffix.lower()
    large = place in _PICTURES
    kinds = CALIBRATION_SUFFIXES if place == "calibration" else (suffix,)
    if large:
        kinds = STILLS if camera else VIDEOS | STILLS if _PICTURES[place][1] else VIDEOS
    if suffix not in kinds:
        raise InputError(f"{name} is none of {', '.join(sorted(kinds))}: convert it first")
    most = LARGEST_UPLOAD if large else LARGEST_CALIBRATION
    free = shutil.disk_usage(project).free - _SPARED
    if not 0 < size <= most:
        raise InputError(f"{name} has {size / 1e6:.0f} MB: 1 byte to {most / 1e6:.0f} MB are taken")
    if size > free:
        raise InputError(f"{name} has {size / 1e9:.1f} GB: the disk is full, free some space")
    if place == "calibration":
        return _calibration(project, name, suffix)
    return _picture(project, place, name, camera) if large else project / place


def _picture(project: Path, place: Place, name: str, camera: str) -> Path:
    """Where a camera's video belongs, or its picture. InputError where the camera has another."""
    inside, loose = _PICTURES[place]
    folder = project / inside
    if camera:
        check_plain_name(camera)
        if camera.casefold() in SUBFOLDERS:
            raise InputError(f"no camera can be called {camera}: rename the folder")
    known = pictures_by_camera(folder, stills=loose).get(camera or Path(name).stem)
    if known is not None and known != (folder / (camera or name)):
        raise InputError(
            f"{known.name}{'/' * known.is_dir()} is there for camera {known.stem}: remove it first"
        )
    return folder / camera / name


def _calibration(project: Path, name: str, suffix: str) -> Path:
    """Where a calibration belongs; its format is recognised by its content."""
    if name in _IN_FOLDER:
        target = project / "calibration" / name
    else:
        target = project / f"calibration{suffix}"
    present = calibration_path(project)
    if present is not None and present not in (target, target.parent):
        raise InputError(f"{present.name} is there: remove it first, then add {name}")
    return target


async def receive(reader: StreamReader, size: int, target: Path, name: str) -> None:
    """Writes what is sent, whole or not at all. InputError where it is not what its place needs, or
    the system refuses; asyncio.IncompleteReadError or TimeoutError where not all of it comes.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(target, error) from error
    try:
        with replacing(target) as partial:
            with partial.open("wb") as file:
                while (left := size - file.tell()) > 0:
                    async with asyncio.timeout(_SILENT_S):
                        piece = await reader.readexactly(min(left, _PIECE))
                    await asyncio.to_thread(file.write, piece)
                file.flush()
                await asyncio.to_thread(os.fsync, file.fileno())
            try:
                await asyncio.to_thread(_check, partial, target.name)
            except InputError as error:
                raise InputError(str(error).replace(str(partial), name)) from None
    except BaseException:
        with suppress(OSError):  # there is something in it
            target.parent.rmdir()
        raise


def _check(path: Path, name: str) -> None:
    """Checks that a file is what its name says, and that it names no other file."""
    if name == "subject.toml":
        body = parse_toml(load_text(path, LARGEST_CALIBRATION), path).get("body")
        if isinstance(body, str) and body_preset(body) is None:
            raise InputError(
                f"{name} names a body's file, {body[:40]!r}: take a name of `voxelpose body list`,"
                " or choose a result with the setting `body`"
            )
        read_subject(path)
    elif path.suffix.lower() in VIDEOS:
        with path.open("rb") as file:
            if not _NO_TEXT.search(file.read(4096)):  # a list of other files, for example
                raise InputError(f"{name} is text, no video: choose the video itself")
        FrameReader.open(path)
    elif path.suffix.lower() in STILLS:
        read_still(path)


def project_files(project: Path) -> list[dict[str, Any]]:
    """Files that a project holds, and folders of pictures: `place`, `name` as for `remove_file`,
    `bytes`, None where it cannot be removed, and the number of `pictures` in a folder.
    """
    calibration = calibration_path(project)
    files: list[tuple[Place, Path]] = [
        *((place, path) for place in _PICTURES for path in _of_cameras(project, place)),
        *([("calibration", calibration)] if calibration else []),
        *((name, project / name) for name in SINGLE_FILES if (project / name).is_file()),
    ]
    rows = []
    for place, path in files:
        row = {"place": place, "name": path.relative_to(project).as_posix(), "pictures": None}
        if path.is_file():
            row["bytes"] = path.stat().st_size
        elif place == "calibration":
            row["bytes"] = None
        else:
            sizes = [picture.stat().st_size for picture in _stills(path)]
            row |= {"bytes": sum(sizes), "pictures": len(sizes)}
        rows.append(row)
    return rows


def _of_cameras(project: Path, place: Place) -> Iterator[Path]:
    """Videos and folders of pictures of a place."""
    inside, loose = _PICTURES[place]
    kinds = VIDEOS | STILLS if loose else VIDEOS
    for path in visible_entries(project / inside):
        if path.is_dir():
            if path.name not in SUBFOLDERS and is_image_folder(path):
                yield path
        elif path.suffix.lower() in kinds:
            yield path


def _stills(folder: Path) -> list[Path]:
    return [path for path in visible_entries(folder) if path.suffix.lower() in STILLS]


def remove_file(project: Path, name: str) -> None:
    """Removes one of the files that `project_files` names, or the pictures of a folder. InputError
    where it is none.
    """
    known = {file["name"]: file["bytes"] for file in project_files(project)}
    path = project / name
    if known.get(name) is None:
        raise InputError(f"there is no file {name[:80]!r} that can be removed here")
    try:
        if not path.is_dir():
            path.unlink()
            return
        for picture in _stills(path):
            picture.unlink()
        if not visible_entries(path):
            shutil.rmtree(path)
    except OSError as error:
        raise InputError(f"{name} cannot be removed: {error.strerror or error}") from error
