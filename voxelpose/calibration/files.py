"""Output files of a calibration: the calibration itself, a report and a picture."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.camera import Rig
from calib.errors import InputError
from calib.files import write_rig
from voxelpose.atomic import replacing
from voxelpose.results import as_json
from voxelpose.view.images.canvas import Image, png


def beside(out: Path, suffix: str) -> Path:
    """Path of an accompanying file, such as calibration_rig.png for calibration.toml."""
    return out.with_name(f"{out.stem}_{suffix}")


def write_png(picture: Image, path: Path) -> None:
    """Writes a picture as PNG. A failure leaves no partial file.

    Raises:
        InputError: The file cannot be written.
    """
    with replacing(path) as partial:
        partial.write_bytes(png(picture))


def write_calibration(
    rig: Rig, out: Path, notes: Mapping[str, Any], others: Mapping[Path, bytes]
) -> None:
    """Writes a calibration and its accompanying files. A failure leaves no partial file.

    Args:
        rig: The cameras.
        out: The calibration; its suffix selects the format.
        notes: Stored in the calibration, if its format supports that.
        others: Content of the other files by path.

    Raises:
        InputError: A file cannot be written.
    """
    partials = {path: path.with_name(f".{path.name}.{os.getpid()}") for path in others}
    try:
        for path, content in others.items():
            partials[path].write_bytes(content)
        write_rig(rig, out, notes=notes)
        for path, partial in partials.items():
            partial.replace(path)
    except OSError as error:
        raise InputError(f"{out}: cannot write: {error.strerror or error}") from None
    finally:
        for partial in partials.values():
            partial.unlink(missing_ok=True)


def report_json(document: Mapping[str, object]) -> bytes:
    """JSON encoding of a report."""
    return as_json(document).encode()
