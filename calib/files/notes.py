"""Entries under [metadata] of a calibration in TOML, beside the unit."""

from pathlib import Path
from typing import Any

from calib.checks import FloatArray
from calib.documents import LARGEST_CALIBRATION, load_text, parse_toml
from calib.errors import InputError
from calib.upright import direction_of


def read_notes(path: Path) -> dict[str, Any]:
    """Entries under [metadata] of a calibration, without the unit; empty if there are none."""
    try:
        content = parse_toml(load_text(path, LARGEST_CALIBRATION), path)
    except InputError:  # a calibration of another format
        return {}
    metadata = content.get("metadata", {})
    metadata = metadata if isinstance(metadata, dict) else {}
    return {key: value for key, value in metadata.items() if key not in ("unit", "units")}


def read_up(path: Path) -> FloatArray | None:
    """Direction of up (3,) in the world as `[metadata] up` states it; None if it does not.

    Raises:
        InputError: it is neither an axis nor three numbers.
    """
    stated = read_notes(path).get("up")
    if stated is None:
        return None
    text = ",".join(map(str, stated)) if isinstance(stated, list) else str(stated)
    return direction_of(text, where=f"{path}: [metadata] ")
