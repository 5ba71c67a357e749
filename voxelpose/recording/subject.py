"""subject.toml of a recording folder, the person that was filmed; and voxelpose.toml, settings that
a folder, those above it or a user have in common.
"""

import datetime
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta
from platformdirs import user_config_path

from calib.errors import InputError
from calib.storage.documents import LARGEST_SETTINGS, load_text, parse_toml
from silhouette_core.setting_types import CHESTS_M, STATURES_M, Chest, Sex, Stature

_METRES = "give metres between {:g} and {:g}, for example {} = {}"
_TEXT = "give text of at most {} characters in quotation marks, or remove the line"
# Types of the values by their keys, and what helps where one is none.
_VALUES = {
    "stature": (Stature, _METRES.format(*STATURES_M, "stature", "1.75")),
    "chest_girth": (Chest, _METRES.format(*CHESTS_M, "chest_girth", "1.02")),
    "sex": (Sex, 'use "male", "female" or "unknown"'),
    "body": (
        Annotated[str, Meta(min_length=1, max_length=200)],
        "give a name of voxelpose body list, or a file's, or remove the line",
    ),
    "name": (Annotated[str, Meta(max_length=200)], _TEXT.format(200)),
    "date": (datetime.date, "write year, month and day, for example date = 2026-11-28"),
    "remarks": (Annotated[str, Meta(max_length=4000)], _TEXT.format(4000)),
}
NOTES = "name", "date", "remarks"
"""Keys of subject.toml that are handed on as they are, and change no result."""
SETTINGS_FILE = "voxelpose.toml"


@dataclass(frozen=True)
class Subject:
    """The person that was filmed; None where subject.toml does not state a value."""

    stature_m: float | None = None  #: height, metres.
    chest_girth_m: float | None = None  #: chest girth, metres.
    sex: Sex = "unknown"  #: "male", "female" or "unknown".
    body: str | None = None
    """The body, as `load_body` names it; `fit` and `track` take it where no other is given."""
    name: str | None = None  #: name or code of the person.
    date: datetime.date | None = None  #: of the recording.
    remarks: str | None = None  #: of whoever recorded.


def read_subject(path: Path) -> Subject:
    """Reads subject.toml; a missing file gives a subject about whom nothing is known. InputError
    where the file is not TOML, or a key or value is not understood.
    """
    if not path.exists():
        return Subject()
    table = parse_toml(load_text(path, LARGEST_SETTINGS), path)
    known: dict[str, Any] = {}
    for key, value in table.items():
        if key not in _VALUES:
            raise InputError(f"{path}: {key[:40]} is not known: use {', '.join(_VALUES)}")
        kind, remedy = _VALUES[key]
        try:
            day = value.date() if isinstance(value, datetime.datetime) else value
            known[key] = msgspec.convert(day, kind)
        except (msgspec.ValidationError, OverflowError):
            fault = f"{path}: {key} = {str(value)[:40]} is impossible"
            raise InputError(f"{fault}: {remedy}") from None
    body = None if "body" not in known else _body_of(known["body"], path)
    return Subject(
        known.get("stature"),
        known.get("chest_girth"),
        known.get("sex", "unknown"),
        body,
        known.get("name", "").strip() or None,
        known.get("date"),
        known.get("remarks", "").strip() or None,
    )


def _body_of(name: str, path: Path) -> str:
    """A preset's name as it is, a file's as a path beside subject.toml."""
    # Slow to load, and every command looks for its settings here first.
    from silhouette_core.body.presets import body_preset

    if body_preset(name) is not None:
        return name
    body = path.parent / name
    if not body.exists():
        raise InputError(
            f"{path}: body file {body} is missing: correct the path or remove the line"
        )
    return str(body.resolve())


def settings_files(folder: Path) -> list[Path]:
    """Files that hold settings for a folder, such as a recording, the nearest first; links are
    followed.

    They are those in the folder, in every folder above it, and in the user's configuration folder.
    """
    start = Path(os.path.realpath(folder))
    folders = (start, *start.parents, user_config_path("voxelpose"))
    files = dict.fromkeys(folder / SETTINGS_FILE for folder in folders)
    # os.path takes a folder that must not be read for one without the file.
    return [file for file in files if os.path.isfile(file)]  # noqa: PTH113


def nearest_settings(
    folder: Path, read: Callable[[Path], Mapping[str, Any]]
) -> dict[str, tuple[Any, Path]]:
    """Settings for a folder by their names, as `read` takes them from each of its files, and the
    file that each is from: of those that have it the nearest.
    """
    return {
        name: (value, file)
        for file in reversed(settings_files(folder))
        for name, value in read(file).items()
    }
