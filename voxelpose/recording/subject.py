"""subject.toml of a recording folder, the person that was filmed; and voxelpose.toml, settings that
a folder, those above it or a user have in common.
"""

import datetime
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from platformdirs import user_config_path

from calib.errors import InputError
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.sizes import CHESTS_M, STATURES_M

_LARGEST_BYTES = 1_000_000
_SIZES_M = {"stature": STATURES_M, "chest_girth": CHESTS_M}
# Longest texts, characters.
_TEXTS = {"name": 200, "remarks": 4000}
_KNOWN = "stature, chest_girth (metres), sex, body, name, date, remarks"
NOTES = "name", "date", "remarks"
"""Keys of subject.toml that are handed on as they are, and change no result."""
SETTINGS_FILE = "voxelpose.toml"


@dataclass(frozen=True)
class Subject:
    """The person that was filmed; None where subject.toml does not state a value.

    Attributes:
        stature_m: height, metres.
        chest_girth_m: chest girth, metres.
        sex: "male", "female" or "unknown".
        body: the body, as `load_body` names it; `fit` and `track` take it where no other is given.
        name: name or code of the person.
        date: of the recording.
        remarks: of whoever recorded.
    """

    stature_m: float | None = None
    chest_girth_m: float | None = None
    sex: str = "unknown"
    body: str | None = None
    name: str | None = None
    date: datetime.date | None = None
    remarks: str | None = None


def read_subject(path: Path) -> Subject:
    """Reads subject.toml; a missing file gives a subject about whom nothing is known.

    Raises:
        InputError: the file is not TOML, or a key or value is not understood.
    """
    if not path.exists():
        return Subject()
    table = parse_toml(load_text(path, _LARGEST_BYTES), path)
    for key in table:
        if key not in ("stature", "chest_girth", "sex", "body", *NOTES):
            raise InputError(f"{path}: {key[:40]} is not known: use {_KNOWN}")
    for key, (least, most) in _SIZES_M.items():
        value = table.get(key)
        if value is not None and (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not least <= value <= most
        ):
            raise InputError(
                f"{path}: {key} = {str(value)[:40]} is impossible: give metres between {least:g}"
                f" and {most:g}, for example {key} = {1.75 if key == 'stature' else 1.02}"
            )
    sex = table.get("sex", "unknown")
    if sex not in ("male", "female", "unknown"):
        raise InputError(
            f'{path}: sex = {str(sex)[:40]!r} is not known: use "male", "female" or "unknown"'
        )
    name = table.get("body")
    if name is not None and not (isinstance(name, str) and 0 < len(name) < 200):
        raise InputError(
            f"{path}: body must be a name of voxelpose body list, or a file's: correct it or remove"
            " the line"
        )
    body = None if name is None else _body_of(name, path)
    texts = {key: _text_of(key, table.get(key), path) for key in _TEXTS}
    date = _date_of(table.get("date"), path)
    return Subject(table.get("stature"), table.get("chest_girth"), sex, body, date=date, **texts)


def _text_of(key: str, value: Any, path: Path) -> str | None:
    if value is None:
        return None
    if not isinstance(value, str) or len(value) > _TEXTS[key]:
        raise InputError(
            f"{path}: {key} must be text of at most {_TEXTS[key]} characters in quotation marks:"
            " correct it or remove the line"
        )
    return value.strip() or None


def _date_of(value: Any, path: Path) -> datetime.date | None:
    if isinstance(value, datetime.datetime):
        return value.date()
    if value is None or isinstance(value, datetime.date):
        return value
    try:
        return datetime.date.fromisoformat(value)
    except (TypeError, ValueError):
        raise InputError(
            f"{path}: date = {str(value)[:40]!r} is no date: write year, month and day, for example"
            " date = 2026-11-28"
        ) from None


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
