"""The person that was filmed: subject.toml of a recording folder."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

from calib.errors import InputError


@dataclass(frozen=True)
class Subject:
    """The person that was filmed; None where subject.toml does not state a value.

    Attributes:
        stature_m: height, metres.
        chest_girth_m: chest girth, metres.
        sex: "male", "female" or "unknown".
        body: file of a body model.
    """

    stature_m: float | None = None
    chest_girth_m: float | None = None
    sex: str = "unknown"
    body: Path | None = None


def read_subject(path: Path) -> Subject:
    """Reads subject.toml; a missing file gives a subject about whom nothing is known.

    Args:
        path: the file.

    Raises:
        InputError: the file is not TOML, or a key or value is not understood.
    """
    if not path.exists():
        return Subject()
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise InputError(f"{path} cannot be read as TOML: {error}") from None
    for key in table:
        if key not in ("stature", "chest_girth", "sex", "body"):
            raise InputError(
                f"{path}: {key} is not known: use stature, chest_girth (metres), sex, body"
            )
    for key in ("stature", "chest_girth"):
        value = table.get(key)
        if value is not None and (
            isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 3
        ):
            raise InputError(
                f"{path}: {key} = {value!r} is impossible: give metres, for example {key} = 1.02"
            )
    sex = table.get("sex", "unknown")
    if sex not in ("male", "female", "unknown"):
        raise InputError(f'{path}: sex = {sex!r} is not known: use "male", "female" or "unknown"')
    body = None if table.get("body") is None else path.parent / str(table["body"])
    if body is not None and not body.exists():
        raise InputError(
            f"{path}: body file {body} is missing: correct the path or remove the line"
        )
    return Subject(table.get("stature"), table.get("chest_girth"), sex, body)
