"""Output files of a calibration: the calibration itself, a report and a picture."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from calib.atomic import replacing, write_whole
from calib.camera import Rig
from calib.files import write_rig
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
    write_whole(path, png(picture))


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
    with ExitStack() as complete:
        for path, content in others.items():
            complete.enter_context(replacing(path)).write_bytes(content)
        write_rig(rig, out, notes=notes)


def report_json(document: Mapping[str, object]) -> bytes:
    """JSON encoding of a report."""
    return as_json(document).encode()
