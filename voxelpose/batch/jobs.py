"""The jobs of a batch: recordings with the settings of each, named on the command line or listed in
a TOML file.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from calib.documents import load_text, parse_toml, visible_entries
from calib.errors import InputError
from calib.upright import direction_of
from silhouette_core.estimator import Settings
from silhouette_core.motion.conditioning import Conditioning
from voxelpose.multiview.people import number_of_people
from voxelpose.recording.folder import Recording, frame_range, is_recording

Command = Literal["fit", "track"]

_LARGEST_LIST = 10_000_000  # bytes
# Setting of a job: the type that it has in TOML, and the field of Settings that it sets, if any.
_SETTINGS = {
    "stature": (float, "stature_m"),
    "chest": (float, "chest_m"),
    "sex": (str, "sex"),
    "background": (str, "background"),
    "network": (str, "network"),
    "smooth": (bool, "smooth"),
    "filter": (str, "conditioning.filter"),
    "cutoff": (float, "conditioning.cutoff_hz"),
    "filter_order": (int, "conditioning.filter_order"),
    "gap_limit": (int | str, "conditioning.gap_limit"),
    "gap_method": (str, "conditioning.gap_method"),
    "up": (str, ""),
    "frames": (str, ""),
    "unit": (str, ""),
    "fps": (float, ""),
    "label": (str, ""),
    "backend": (str, "backend"),
    "estimator": (str, ""),
}
_OPTIONS = {
    "fit": {
        "cameras": (str, ""),
        "interference": (bool, "options.interference"),
        "voxel": (float, "options.voxel_size_m"),
        "tolerance": (int, "options.tolerance"),
        "repair": (str, "options.repair"),
        "body": (str, "options.body"),
        "people": (int | str, ""),
    },
    "track": {
        "camera": (str, ""),
        "library": (str, "options.library"),
        "start": (str, "options.start"),
        "outline_only": (bool, "options.outline_only"),
        "body": (str, "options.body"),
    },
}
_WORDS = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "text",
    int | str: "a whole number, or text",
}
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

    def with_defaults(self, defaults: Mapping[str, Any], files: Mapping[str, str]) -> Job:
        """The job with the settings of files where it has none; a batch decides on the rest itself.

        Args:
            defaults: values by name, as the options of the command.
            files: the file that each was taken from.

        Raises:
            InputError: a value is not understood.
        """
        known = (_SETTINGS.keys() | _OPTIONS[self.command].keys()) - self.settings.keys()
        taken = {name: value for name, value in defaults.items() if name in known}
        for name, value in taken.items():
            _check({name: value}, self.command, files[name])
        sources = {name: files[name] for name in taken}
        return replace(self, settings=taken | dict(self.settings), sources=sources)

    def open(self) -> Recording:
        """The recording; InputError where it cannot be used."""
        given = self.settings
        key = "camera" if self.command == "track" else "cameras"
        names = [name.strip() for name in str(given.get(key, "")).split(",") if name.strip()]
        if self.command == "track" and not names:
            unit, label = _text(given, "unit"), _text(given, "label")
            names = [Recording.open(self.recording, unit=unit, label=label).rig.names[0]]
        return Recording.open(
            self.recording,
            frame_range(_text(given, "frames"), 'frames = "{}"'),
            names or None,
            _text(given, "unit"),
            float(given["fps"]) if "fps" in given else None,
            _text(given, "label"),
        )

    def estimator_settings(self, threads: int | None) -> Settings:
        """Settings of the estimation with a number of threads, None: all cores; InputError where a
        value cannot be used.
        """
        fields = _fields(self.settings, self.command, "")
        if "up" in self.settings:
            fields["up"] = tuple(direction_of(str(self.settings["up"])).tolist())
        return Settings(
            **fields,
            threads=threads,
            conditioning=Conditioning(**_fields(self.settings, self.command, "conditioning")),
            options=_fields(self.settings, self.command, "options"),
        )

    @property
    def estimator(self) -> str:
        """Name of the estimator."""
        usual = "monocular" if self.command == "track" else "multiview"
        return str(self.settings.get("estimator", usual))

    @property
    def people(self) -> int | None:
        """Number of people; None: as many as are seen."""
        usual = 1 if self.command == "track" else "auto"
        return number_of_people(str(self.settings.get("people", usual)), 'people = "{}"')


def jobs_of(
    paths: Sequence[Path], command: Command, common: Mapping[str, bool | int | float | str]
) -> list[Job]:
    """The jobs of recordings, of folders of recordings, and of TOML lists.

    Args:
        paths: a recording; a folder whose subfolders are recordings; or a TOML file with a table
            `[[recording]]` for each, with `folder` (relative to the file) and, where they differ,
            `name`, `command` and the settings.
        command: what is done where a list does not say.
        common: settings where a list has no other.

    Raises:
        InputError: something is not there or not understood, or nothing is to be done.
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
        _check(job.settings, job.command, job.recording)
        folder = Path(job.recording).resolve()
        name = _free_name(job.name or folder.name, {other.name.lower() for other in jobs})
        jobs.append(replace(job, name=name, recording=str(folder), settings=dict(job.settings)))
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
        _check(settings, kind, f"{path}: recording {number}")
        listed.append(Job(name, str(folder), kind, settings))
    return listed


def _check(settings: Mapping[str, Any], command: Command, where: str) -> None:
    known = _SETTINGS | _OPTIONS[command]
    for name, value in settings.items():
        if name not in known:
            raise InputError(
                f"{where}: {command} has no setting {name[:40]!r}: it has"
                f" {', '.join(sorted(known))}"
            )
        kind = known[name][0]
        fits = isinstance(value, int | float) if kind is float else isinstance(value, kind)
        if not fits or (isinstance(value, bool) and kind is not bool):
            raise InputError(f"{where}: {name} = {str(value)[:60]!r} must be {_WORDS[kind]}")
    try:
        frame_range(_text(settings, "frames"), 'frames = "{}"')
        if "up" in settings:
            direction_of(str(settings["up"]))
        number_of_people(str(settings.get("people", "auto")), 'people = "{}"')
        Conditioning(**_fields(settings, command, "conditioning"))
    except InputError as error:
        raise InputError(f"{where}: {str(error)[:300]}") from None


def _free_name(wanted: str, taken: Container[str]) -> str:
    """A name plain enough for a folder, and numbered where it is taken, in small letters."""
    plain = _PLAIN_NAME.sub("_", wanted).strip("._") or "recording"
    name, count = plain, 1
    while name.lower() in taken:
        count += 1
        name = f"{plain}_{count}"
    return name


def _text(settings: Mapping[str, object], name: str) -> str | None:
    return str(settings[name]) if name in settings else None


def _fields(settings: Mapping[str, Any], command: Command, group: str) -> dict[str, Any]:
    """Values of the settings that set fields of a group, by field."""
    known = _SETTINGS | _OPTIONS[command]
    fields = {}
    for name, value in settings.items():
        place, _, field = known[name][1].rpartition(".")
        if field and place == group:
            fields[field] = value
    return fields
