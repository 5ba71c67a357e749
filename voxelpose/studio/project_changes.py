"""Projects and results renamed, duplicated, and deleted: into a bin, from which they can be put
back for a day.
"""

import os
import shutil
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import tomlkit

from calib.errors import InputError
from calib.storage.atomic import write_whole, writing
from calib.storage.documents import LARGEST_CALIBRATION, load_text, visible_entries
from voxelpose.recording.frame_reader import STILLS, VIDEOS
from voxelpose.result_documents import path_from
from voxelpose.results import SETTINGS, is_result, people_folders
from voxelpose.studio.projects import StudioFolder, check_plain_name, error_at

_BIN = ".bin"  # in the studio's folder; what was deleted is, each in a folder of its time
_KEPT_S = 24 * 3600
_NS = 10**9


class ProjectChanges:
    """Changes of whole projects and results of a folder."""

    def __init__(self, folder: StudioFolder) -> None:
        self._folder, self._bin = folder, folder.root / _BIN

    def rename(self, name: str, to: str) -> None:
        """Gives a project or a result another name. InputError where that cannot be."""
        old = self._folder.entry(name)
        new = self._free(old.parent, to)
        results = [] if is_result(old) else self._folder.results_of(old)
        _move(old, new)
        for result in results:  # they say where their recording is
            for person in people_folders(result):
                settings = tomlkit.parse(load_text(person / SETTINGS, LARGEST_CALIBRATION))
                settings["recording"] = path_from(person, new)
                write_whole(person / SETTINGS, tomlkit.dumps(settings))

    def duplicate(self, name: str, to: str) -> None:
        """Makes another project of the same files. InputError where that cannot be."""
        old = self._folder.project(name)
        new = self._free(old.parent, to)
        partial = new.with_name(f".{to}.new")
        try:
            shutil.copytree(old, partial, symlinks=True, copy_function=_linked)
            partial.rename(new)
        except (OSError, shutil.Error) as error:
            raise InputError(f"{to} cannot be written: {error}") from error
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def delete(self, name: str) -> None:
        """Moves a project or a result into the bin. InputError where that cannot be."""
        self._folder.checked_inside(self._bin)
        old = self._folder.entry(name)
        _move(old, self._bin / str(time.time_ns()) / name)
        if old.parent != self._folder.root:
            with suppress(OSError):  # the batch has more
                old.parent.rmdir()

    def put_back(self, deleted: str) -> None:
        """Puts back what was deleted. InputError where it is gone, or its name is taken."""
        for path, name, identifier in self._deleted():
            if identifier == deleted:
                above, _, last = name.rpartition("/")
                _move(path, self._free(self._folder.root / above, last))
                shutil.rmtree(self._bin / deleted, ignore_errors=True)
                return
        raise InputError("that is not in the bin any more: load this page again")

    def empty(self) -> None:
        """Removes what is in the bin."""
        self._remove_older(0)

    def bin(self) -> list[dict[str, Any]]:
        """What was deleted within a day, the latest first: `id`, `name`, `bytes`. What is older is
        removed.
        """
        self._remove_older(_KEPT_S)
        return [
            {"id": deleted, "name": name, "bytes": _bytes(path)}
            for path, name, deleted in reversed(self._deleted())
        ]

    def _free(self, folder: Path, name: str) -> Path:
        """A path that is not taken yet. InputError where it is, or cannot be."""
        check_plain_name(name, "to")
        path = folder / name
        if path.exists() or path.is_symlink():
            raise error_at("to", f"there is a {name!r} already: choose another name")
        return path

    def _remove_older(self, seconds: float) -> None:
        if self._folder.holds(self._bin):
            for time_ns in self._times():
                if time.time_ns() - int(time_ns.name) >= seconds * _NS:
                    shutil.rmtree(time_ns, ignore_errors=True)

    def _times(self) -> list[Path]:
        return [path for path in visible_entries(self._bin) if path.name.isdecimal()]

    def _deleted(self) -> list[tuple[Path, str, str]]:
        """Folders in the bin, the names that they had, and the times under which they lie."""
        entries = []
        for time_ns in self._times():
            for path in visible_entries(time_ns):
                inner = visible_entries(path)
                # A result of a batch lies in the batch's folder.
                if len(inner) == 1 and is_result(inner[0]) and not is_result(path):
                    path = inner[0]
                entries.append((path, path.relative_to(time_ns).as_posix(), time_ns.name))
        return entries


def _move(path: Path, target: Path) -> None:
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        path.rename(target)


def _linked(source: str, target: str) -> None:
    """Gives a picture or video, which is only ever replaced, a second name; copies all else."""
    if Path(source).suffix.lower() in VIDEOS | STILLS:
        with suppress(OSError):
            os.link(source, target, follow_symlinks=False)
            return
    shutil.copy2(source, target, follow_symlinks=False)


def _bytes(folder: Path) -> int:
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir())
