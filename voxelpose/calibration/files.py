"""What calibrations are written to: the calibration, and beside it a report and a picture, all of
them or none.
"""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2

from calib.camera import Rig
from calib.errors import InputError
from calib.files import write_rig
from voxelpose.results import as_json
from voxelpose.view.images.canvas import Image


def beside(out: Path, what: str) -> Path:
    """Returns the name of a file that goes with a calibration: calibration_rig.png beside
    calibration.toml.
    """
    return out.with_name(f"{out.stem}_{what}")


def refuse_existing(paths: list[Path], overwrite: bool) -> None:
    """Looks at where results are to go, before any work is done.

    Raises:
        InputError: A file exists and is not to be replaced, or its folder does not exist.
    """
    for path in paths:
        if path.exists() and not overwrite:
            raise InputError(
                f"{path} exists: give --out another name, or add --overwrite to replace it"
            )
        if not path.parent.is_dir():
            raise InputError(
                f"{path}: there is no folder {path.parent}: make it, or give --out another name"
            )


def png(picture: Image) -> bytes:
    """Returns a picture as PNG."""
    good, data = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    if not good:
        raise OSError("PNG")
    return data.tobytes()


def write_png(picture: Image, path: Path) -> None:
    """Writes a picture, whole or not at all.

    Raises:
        InputError: The file cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        partial.write_bytes(png(picture))
        partial.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        partial.unlink(missing_ok=True)


def write_calibration(
    rig: Rig, out: Path, notes: Mapping[str, Any], others: Mapping[Path, bytes]
) -> None:
    """Writes a calibration and what goes with it; nothing is left half written.

    Args:
        rig: The cameras.
        out: The calibration; its suffix chooses the format.
        notes: Kept in the calibration, where its format has a place for it.
        others: Content by path.

    Raises:
        InputError: A file cannot be written.
    """
    waiting = {path: path.with_name(f".{path.name}.{os.getpid()}") for path in others}
    try:
        for path, content in others.items():
            waiting[path].write_bytes(content)
        write_rig(rig, out, notes=notes)
        for path, partial in waiting.items():
            partial.replace(path)
    except OSError as error:
        raise InputError(f"{out}: cannot write: {error.strerror or error}") from None
    finally:
        for partial in waiting.values():
            partial.unlink(missing_ok=True)


def report_json(document: Mapping[str, object]) -> bytes:
    """Returns a report as JSON."""
    return as_json(document).encode()


def notes_of(path: Path) -> dict[str, Any]:
    """Returns what a calibration keeps under [metadata] beside its unit; nothing where it has no
    such place.
    """
    try:
        metadata = tomllib.loads(path.read_text(encoding="utf-8-sig")).get("metadata", {})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return {}
    return (
        {key: value for key, value in metadata.items() if key not in ("unit", "units")}
        if isinstance(metadata, dict)
        else {}
    )
