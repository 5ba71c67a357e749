"""Files that somebody sends into a project: where each belongs, and how it gets there whole."""

import asyncio
import os
import re
import shutil
from asyncio import StreamReader
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from calib.errors import InputError
from calib.storage.atomic import replacing, writing
from calib.storage.documents import LARGEST_CALIBRATION, load_text, parse_toml, visible_entries
from silhouette_core.body.presets import body_preset
from voxelpose.recording.camera_files import SUBFOLDERS, is_image_folder
from voxelpose.recording.chapters import chapters_in, open_camera
from voxelpose.recording.folder import calibration_path
from voxelpose.recording.frame_reader import STILLS, VIDEOS, FrameReader, read_still
from voxelpose.recording.subject import read_subject
from voxelpose.studio.file_places import LOOSE, Slot, Take, holder_of, slot_of
from voxelpose.studio.projects import SINGLE_FILES
from voxelpose.view.images.canvas import encoded, reduced

LARGEST_UPLOAD = 32 * 2**30
"""Bytes of a file: hours of a camera."""
_SPARED = 2**30  # bytes of the disk that stay free
_SILENT_S = 60  # without a piece, after which whoever sends is gone
_PIECE = 2**18
_LONG_SIDE_PX = 480  # of a picture on the page
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")


def check_size(project: Path, path: str, size: int, coming: int = 0) -> None:
    """Checks the size in bytes of a file that belongs at a path in a project, when others of
    `coming` bytes are there. InputError where it is too large, or the disk too full.
    """
    most = LARGEST_UPLOAD if slot_of(path).place in LOOSE else LARGEST_CALIBRATION
    if not 0 < size <= most:
        raise InputError(f"{path} has {size / 1e6:.0f} MB: 1 byte to {most / 1e6:.0f} MB are taken")
    if size + coming > shutil.disk_usage(project).free - _SPARED:
        raise InputError(f"{path} has {size / 1e9:.1f} GB: the disk is full, free some space")


def present_at(project: Path, path: str) -> Path | None:
    """What has the place of a file in a project: a file of that path, or another that holds the
    same camera, or a calibration; None: nothing.
    """
    target, slot = project / path, slot_of(path)
    if target.exists():
        return target
    if target.parent.is_dir() and holder_of(path, slot) != path:
        return None  # beside others of its camera, or calibration
    if slot.place == "calibration":
        return calibration_path(project)
    return next(_of_cameras(project, slot.place, slot.camera), None)


def conflicts_of(
    project: Path, take: Take, sizes: Sequence[tuple[str, int, float]]
) -> tuple[list[dict[str, Any]], set[str]]:
    """What files of a take would replace in a project, and the paths of these files there.

    Each camera's pictures, or other file, is a row of what is there, and what is `new`: `name`,
    `files` (how many), `bytes`, time `modified`; the name by which the one has a `picture`, and the
    `number` of the other.

    Args:
        sizes: name, bytes and time of modification of each file.
    """
    rows: dict[Slot, list[tuple[str, Path, int]]] = defaultdict(list)
    for path, number in take.files.items():
        if (present := present_at(project, path)) is not None:
            rows[slot_of(path)].append((path, present, number))
    conflicts = []
    for slot, files in rows.items():
        present = [*dict.fromkeys(present for _, present, _ in files)]
        inside = [each for path in present for each in _pictures(path) or [path]]
        before = [
            (each.relative_to(project).as_posix(), each.stat().st_size, each.stat().st_mtime)
            for each in inside
        ]
        new = _row([sizes[number] for *_, number in files]) | {"number": files[0][2]}
        picture = holder_of(before[0][0], slot) if slot.place in LOOSE else None
        conflicts.append(_row(before) | {"picture": picture, "new": new})
    return conflicts, {path for files in rows.values() for path, *_ in files}


def _row(files: Sequence[tuple[str, int, float]]) -> dict[str, Any]:
    names, sizes, times = zip(*files, strict=True)
    return {"name": names[0], "files": len(files), "bytes": sum(sizes), "modified": max(times)}


async def receive(reader: StreamReader, size: int, target: Path, present: Path | None) -> None:
    """Writes what is sent, whole or not at all, in the place of what is `present`. InputError where
    it is not what its place needs, or the system refuses; asyncio.IncompleteReadError or
    TimeoutError where not all of it comes.
    """
    is_new = not target.parent.exists()
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
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
                raise InputError(str(error).replace(str(partial), target.name)) from None
        if present is not None and present != target and present.name != "calibration":
            await asyncio.to_thread(remove_pictures, present)
    except BaseException:
        if is_new:
            with suppress(OSError):  # there is something in it by now
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
    files = [
        *((place, path) for place in LOOSE for path in _of_cameras(project, place)),
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
            sizes = [picture.stat().st_size for picture in _pictures(path)]
            row |= {"bytes": sum(sizes), "pictures": len(sizes)}
        rows.append(row)
    return rows


def _of_cameras(project: Path, place: str, camera: str | None = None) -> Iterator[Path]:
    """Videos and folders of pictures of a place, of all cameras or one."""
    for path in visible_entries(project if place == "video" else project / place):
        is_folder = path.is_dir()
        if path.name in SUBFOLDERS or camera not in (None, path.name if is_folder else path.stem):
            continue
        if _pictures(path) if is_folder else path.suffix.lower() in LOOSE[place]:
            yield path


def _pictures(folder: Path) -> list[Path]:
    """Pictures of a camera in a folder, or the chapters of its film."""
    if not is_image_folder(folder):
        return chapters_in(folder)
    return [path for path in visible_entries(folder) if path.suffix.lower() in STILLS]


def picture_of(project: Path, name: str) -> bytes:
    """The first picture of one of the files that `project_files` names, as JPEG. InputError where
    there is none.
    """
    if not any(file["name"] == name and file["place"] in LOOSE for file in project_files(project)):
        raise InputError(f"there is no picture of {name[:80]!r}")
    picture = next(iter(open_camera(project / name)))
    return encoded(reduced(picture, _LONG_SIDE_PX / max(picture.shape)), ".jpg", 80)


def remove_file(project: Path, name: str) -> None:
    """Removes one of the files that `project_files` names, or the pictures of a folder. InputError
    where it is none.
    """
    known = {file["name"]: file["bytes"] for file in project_files(project)}
    if known.get(name) is None:
        raise InputError(f"there is no file {name[:80]!r} that can be removed here")
    try:
        remove_pictures(project / name)
    except OSError as error:
        raise InputError(f"{name} cannot be removed: {error.strerror or error}") from error


def remove_pictures(path: Path) -> None:
    """Removes a file, or the pictures of a folder, and the folder if nothing else is in it."""
    if not path.is_dir():
        path.unlink()
        return
    for picture in _pictures(path):
        picture.unlink()
    if not visible_entries(path):
        shutil.rmtree(path)
