"""The jobs of a batch: recordings with the settings of each, named on the command line or listed in
a TOML file.
"""

import re
import tomllib
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from calib.errors import InputError
from calib.storage.documents import load_text, parse_toml, visible_entries
from voxelpose.cli.fit import EstimationArguments
from voxelpose.cli.options import checked_values, folder_settings, load_command, made_of, options_of
from voxelpose.cli.track import Track
from voxelpose.recording.folder import Recording, is_recording

Command = Literal["fit", "track"]

_LARGEST_LIST = 10_000_000  # bytes
# Fields of a command that are the batch's, not a recording's.
_OF_BATCH = {"out", "overwrite", "threads", "pictures", "verbose"}
_PLAIN_NAME = re.compile(r"[^\w.+-]+")


@dataclass(frozen=True)
class Job:
    """One recording and how it is estimated."""

    name: str  # name of the result's folder, unique in the batch
    recording: str
    command: Command
    # Values by name, as the options of that command.
    settings: Mapping[str, bool | int | float | str]
    # Files that settings were taken from, by their names.
    sources: Mapping[str, str] = field(default_factory=dict)

    def with_folder_settings(self) -> "Job":
        """The job with what voxelpose.toml of its recording and the folders above it say, where it
        has no setting; a batch decides on the rest itself. InputError where a value is not
        understood.
        """
        in_files = folder_settings(self.command, Path(self.recording))
        named = {name.replace("-", "_"): setting for name, setting in in_files.items()}
        taken = {name: named[name] for name in named.keys() - _OF_BATCH - self.settings.keys()}
        values = {
            name: str(setting.value) if isinstance(setting.value, Path) else setting.value
            for name, setting in sorted(taken.items())
        }
        for name, value in values.items():
            replace(self, settings={name: value}).check(taken[name].file)
        sources = {name: taken[name].file for name in values}
        return replace(self, settings=values | dict(self.settings), sources=sources)

    def estimation(self, where: str = "") -> EstimationArguments:
        """The command with these settings. InputError, which begins with `where`, where there is
        no such setting, or its value is of another type.
        """
        kind, where = load_command(self.command), f"{where or self.name}: {self.command}"
        options = options_of(kind, _OF_BATCH)
        values = checked_values(options, self.settings, Path(), where)
        fixed = {"recording": Path(self.recording), "out": Path(), "listed": True}
        return made_of(kind, {options[name].field: values[name] for name in values} | fixed)

    def check(self, where: str) -> None:
        """Checks the settings; InputError, which begins with `where`, for one without sense."""
        estimation = self.estimation(where)
        try:
            estimation.frame_limits()
            estimation.settings()
            estimation.people_wanted()
        except InputError as error:
            raise InputError(f"{where}: {str(error)[:300]}") from None

    def open(self) -> Recording:
        """The recording; of several cameras that of the first, where one is tracked and none is
        named. InputError where it cannot be used.
        """
        estimation = self.estimation()
        if isinstance(estimation, Track) and estimation.camera is None:
            unit, label = estimation.unit, estimation.label
            names = Recording.open(self.recording, unit=unit, label=label).rig.names
            estimation = replace(estimation, camera=names[0])
        return estimation.open()


def jobs_of(
    paths: Sequence[Path], command: Command, common: Mapping[str, bool | int | float | str]
) -> list[Job]:
    """The jobs of recordings, of folders of recordings, and of TOML lists. InputError where
    something is not there or not understood, or nothing is to be done.

    Args:
        paths: a recording; a folder whose subfolders are recordings; or a TOML file with a table
            `[[recording]]` for each, with `folder` (relative to the file) and, where they differ,
            `name`, `command` and the settings.
        command: what is done where a list does not say.
        common: settings where a list has no other.
    """
    unchecked: list[Job] = []
    for path in paths:
        if path.suffix.lower() == ".toml" and path.is_file():
            unchecked += _jobs_of_list(path, command, common)
        elif not path.is_dir():
            raise InputError(f"there is no recording {path}: give folders, or a TOML list of them")
        elif is_recording(path):
            unchecked.append(Job("", str(path), command, common))
        else:
            inside = [folder for folder in visible_entries(path) if is_recording(folder)]
            if not inside:
                raise InputError(
                    f"{path} is no recording and holds none: give folders with a video per camera"
                    " and calibration.toml"
                )
            unchecked.extend(Job("", str(folder), command, common) for folder in inside)
    jobs: list[Job] = []
    for job in unchecked:
        settings = {name.replace("-", "_"): value for name, value in job.settings.items()}
        job = replace(job, settings=settings)
        job.check(job.recording)
        folder = Path(job.recording).resolve()
        name = _free_name(job.name or folder.name, {other.name.lower() for other in jobs})
        jobs.append(replace(job, name=name, recording=str(folder)))
    return jobs


def read_settings(words: Iterable[str]) -> dict[str, bool | int | float | str]:
    """Settings of the form name=value; values as in TOML, or plain text. InputError where a word
    has no equals sign.
    """
    settings = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name.strip():
            raise InputError(f"--set {word} is not understood: give NAME=VALUE, as in stature=1.75")
        try:
            settings[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except (ValueError, RecursionError):
            settings[name.strip()] = value.strip()
    return settings


def _jobs_of_list(path: Path, command: Command, common: Mapping[str, Any]) -> list[Job]:
    """The jobs of a list, without the names of those that it names not."""
    document = parse_toml(load_text(path, _LARGEST_LIST), path)
    tables, unknown = document.get("recording"), sorted(set(document) - {"recording", "settings"})
    shared = document.get("settings", {})
    if unknown or not isinstance(tables, list) or not tables or not isinstance(shared, dict):
        raise InputError(
            f'{path} lists no recordings: write a table [[recording]] with folder = "..." for'
            " each, and [settings] for what they have in common"
        )
    listed = []
    for number, table in enumerate(tables, 1):
        if not isinstance(table, dict) or not isinstance(table.get("folder"), str):
            raise InputError(f'{path}: recording {number} has no folder = "..."')
        if any(len(part.encode()) > 255 for part in Path(table["folder"]).parts):
            raise InputError(f"{path}: recording {number}: folder is no folder's name: correct it")
        settings = {**common, **shared, **table}
        folder = path.parent / settings.pop("folder")
        name, kind = settings.pop("name", ""), settings.pop("command", command)
        if not isinstance(name, str) or kind not in ("fit", "track"):
            raise InputError(
                f'{path}: recording {number}: name must be text, and command "fit" or "track"'
            )
        if not is_recording(folder):
            raise InputError(f"{path}: recording {number}: {folder} is no recording")
        listed.append(Job(name, str(folder), kind, settings))
        listed[-1].check(f"{path}: recording {number}")
    return listed


def _free_name(wanted: str, taken: Container[str]) -> str:
    """A name plain enough for a folder, and numbered where it is taken, in small letters."""
    plain = _PLAIN_NAME.sub("_", wanted).strip("._") or "recording"
    name, count = plain, 1
    while name.lower() in taken:
        count += 1
        name = f"{plain}_{count}"
    return name
