"""Projects: the recordings in the folder that the studio reads and writes, and their results."""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from calib.errors import InputError, check_name, visible
from calib.storage.atomic import unwritable
from calib.storage.documents import visible_entries
from voxelpose.recording.camera_files import pictures_by_camera
from voxelpose.recording.folder import calibration_path, is_recording
from voxelpose.recording.frame_reader import VIDEOS
from voxelpose.reliability import verdict_of, verdict_of_people
from voxelpose.results import (
    SETTINGS,
    SUMMARY,
    is_corrected,
    is_result,
    load_settings,
    load_summary,
    people_folders,
)

SINGLE_FILES = "subject.toml", "timestamps.csv", "recording.toml", "points.csv", "lenses.toml"
# All that a new project may hold.
_UNFINISHED = {
    *("background", "boards", "board_walk", "board.pdf", "voxelpose.toml"),
    *("lenses_coverage.png", "lenses_lenses.json", *SINGLE_FILES),
}
_LONGEST = 80
_FORBIDDEN = re.compile(r'[\t\n/\\:*?"<>|]|^[.\s-]|[.\s]$')
_OF_WINDOWS = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def check_plain_name(name: str, field: str = "") -> None:
    """Checks that a name, as typed into a field, can be a file's or folder's, and nothing else, on
    every system.

    Raises:
        InputError: it cannot.
    """
    unfit = visible(name) != name or _FORBIDDEN.search(name) or _OF_WINDOWS.fullmatch(name)
    if unfit or not 0 < len(name) <= _LONGEST:
        raise error_at(
            field,
            f"{name[:40]!r} cannot be a name: take letters, digits, - and _, up to {_LONGEST}, as"
            " in anna_walk_1",
        )


def error_at(field: str, line: str) -> InputError:
    """An error in what was typed into a field."""
    error = InputError(line)
    error.field = field
    return error


class StudioFolder:
    """The folder outside of which nothing is read or written.

    Attributes:
        root: its path, without links.
    """

    def __init__(self, root: Path) -> None:
        """InputError where there is no such folder, or it is itself a recording or a result."""
        self.root = root.resolve()
        if not self.root.is_dir():
            raise InputError(f"there is no folder {root}: make it, or give another")
        if is_recording(self.root) or is_result(self.root):
            kind = "result" if is_result(self.root) else "recording"
            raise InputError(
                f"{root} is itself a {kind}: give the folder in which recordings and results lie,"
                f" {self.root.parent}"
            )

    def project(self, name: str) -> Path:
        """Folder of a project; InputError where there is none of this name."""
        check_plain_name(name)
        folder = self.checked_inside(self.root / name)
        if not folder.is_dir() or is_result(folder):
            raise InputError(f"there is no project {name!r}: choose another, or make it")
        return folder

    def new_project(self, name: str) -> None:
        """Makes a folder. InputError where the name cannot be one, or is taken."""
        check_plain_name(name, "name")
        folder = self.root / name
        try:
            folder.mkdir()
        except FileExistsError:
            raise error_at("name", f"there is a {name!r} already: choose another name") from None
        except OSError as error:
            raise unwritable(folder, error) from error

    def result(self, name: str) -> Path:
        """Folder of a result by its name in `results`. InputError where there is none, or its
        recording lies elsewhere.
        """
        folder = self.entry(name)
        if not is_result(folder):
            raise InputError(f"there is no result {name[:80]!r}: estimate first, or choose another")
        for person in people_folders(folder):
            self.checked_inside(self._recording_of(person))
        return folder

    def entry(self, name: str) -> Path:
        """Folder of a project, or of a result, also of one in a batch's folder. InputError where
        there is none.
        """
        parts = name.split("/")
        for part in parts:
            check_plain_name(part)
        folder = self.checked_inside(self.root.joinpath(*parts))
        if not folder.is_dir() or len(parts) > 1 + is_result(folder):
            raise InputError(f"there is no {name[:80]!r} any more: load this page again")
        return folder

    def results_of(self, project: Path) -> list[Path]:
        """Folders of the results of a project."""
        results = []
        for folder in self._result_folders():
            with suppress(InputError):  # it is damaged
                if self._recording_of(people_folders(folder)[0]) == project.resolve():
                    results.append(folder)
        return results

    def out(self, name: str, overwrite: bool) -> Path:
        """Where a result of this name is to be written. InputError where it must not."""
        check_plain_name(name, "out")
        out = self.root / name
        self.checked_inside(out)
        if out.exists() and not overwrite:
            raise error_at(
                "out", f"there is a {name!r} already: choose another name, or replace it"
            )
        if is_corrected(out):
            raise error_at(
                "out",
                f"{name!r} is corrected by hand: choose another name, or undo it in its viewer",
            )
        return out

    def projects(self) -> list[dict[str, Any]]:
        """All projects: `name`, number of `cameras`, whether `calibrated`."""
        projects = []
        for folder in visible_entries(self.root):
            if not folder.is_dir() or is_result(folder) or not self.holds(folder):
                continue
            new = not {path.name for path in visible_entries(folder)} - _UNFINISHED
            cameras = _camera_count(folder)
            if new or cameras or is_recording(folder):
                calibrated = calibration_path(folder) is not None
                projects.append({"name": folder.name, "cameras": cameras, "calibrated": calibrated})
        return projects

    def results(self) -> list[dict[str, Any]]:
        """All results, also in a batch's folder, the latest first: `name`, its `project` (None: not
        here), `level` and `words` of its verdict, its `command`, `frames`, names of several
        `people`, time it was `made`, whether it has a contact `sheet`.
        """
        results = [self._describe_result(folder) for folder in self._result_folders()]
        return sorted(results, key=lambda result: -result["made"])

    def holds(self, path: Path) -> bool:
        """Whether a path, its links followed, lies within."""
        return Path(os.path.realpath(path)).is_relative_to(self.root)

    def file_inside(self, project: Path, text: str) -> Path:
        """A file or result that a setting names, relative to its project or to the root.
        InputError where there is none, or it lies outside.
        """
        check_name(text)
        if "\0" not in text:
            for path in (project / text, self.root / text):
                if path.exists():
                    return self.checked_inside(path)
        raise InputError(f"there is no {text[:80]!r} in {self.root}: correct the setting")

    def checked_inside(self, path: Path) -> Path:
        """A path, of which neither it nor a link in it leads out of the folder. InputError where
        one does.
        """
        for each in (path, *_links_in(path)):
            if not self.holds(each):
                name = os.path.relpath(each, self.root)
                raise InputError(
                    f"{name[-80:]!r} lies outside of {self.root}: start the studio in a folder that"
                    " holds it, or put the file itself in the place of the link"
                )
        return path

    def _result_folders(self) -> Iterator[Path]:
        for folder in visible_entries(self.root):
            if not folder.is_dir() or not self.holds(folder):
                continue
            if is_result(folder):
                yield folder
            elif not is_recording(folder):  # that of a batch
                for inner in visible_entries(folder):
                    if inner.is_dir() and self.holds(inner) and is_result(inner):
                        yield inner

    def _describe_result(self, folder: Path) -> dict[str, Any]:
        known: dict[str, Any] = {
            "name": folder.relative_to(self.root).as_posix(),
            "project": None,
            "made": (folder / SUMMARY).stat().st_mtime,
            "sheet": (folder / "contact_sheet.png").exists(),
        }
        try:
            people = people_folders(self.checked_inside(folder))
            known["project"] = self.project_of(folder)
            summaries = {person.name: load_summary(person / SUMMARY) for person in people}
        except InputError as error:
            return known | {"level": "failed", "words": str(error)}
        verdicts = {name: verdict_of(summary) for name, summary in summaries.items()}
        verdict = verdict_of_people(verdicts) if len(people) > 1 else verdicts[people[0].name]
        counts = [summary["frames"] for summary in summaries.values()]
        posed = [(frames["with_pose"], len(frames["lost"])) for frames in counts]
        frames = ", ".join(f"{count} of {count + lost}" for count, lost in posed)
        whom = f"{len(people)} people, " if len(people) > 1 else ""
        return known | {
            "level": verdict.level,
            "words": str(verdict),
            "command": "fit" if len(next(iter(summaries.values()))["cameras"]) > 1 else "track",
            "frames": f"{whom}{frames} frames",
            "people": [*verdicts] if len(people) > 1 else [],
        }

    def project_of(self, folder: Path) -> str | None:
        """Name of the project of which a result was made; None: it is not here. InputError where
        the result is damaged.
        """
        recording = self._recording_of(people_folders(folder)[0])
        return recording.name if recording.parent == self.root else None

    def _recording_of(self, folder: Path) -> Path:
        settings = load_settings(folder / SETTINGS)
        return (folder / settings.get("recording", "")).resolve()


def _links_in(folder: Path) -> Iterator[Path]:
    """All links in a folder; none where it is no folder."""
    with suppress(NotADirectoryError, FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink():
                yield Path(entry.path)
            elif entry.is_dir():
                yield from _links_in(Path(entry.path))


def _camera_count(folder: Path) -> int:
    try:
        cameras = pictures_by_camera(folder) or pictures_by_camera(folder / "masks")
    except InputError:  # two files of one camera
        return sum(path.suffix.lower() in VIDEOS for path in visible_entries(folder))
    return len(cameras)
