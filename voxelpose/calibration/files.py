"""Output files of a calibration: the calibration itself, a report and a picture."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from calib.atomic import replacing
from calib.camera import Rig
from calib.files import write_rig
from voxelpose.results import as_json
from voxelpose.view.images.canvas import Image, png


def beside(out: Path, suffix: str) -> Path:
    """Path of an accompanying file, such as calibration_rig.png for calibration.toml."""
    return out.with_name(f"{out.stem}_{suffix}")


def write_calibration(
    rig: Rig,
    out: Path,
    notes: Mapping[str, Any],
    picture: tuple[Path, Image],
    report: tuple[Path, Mapping[str, object]],
) -> None:
    """Writes a calibration, a picture and a report. A failure leaves no partial file.

    Args:
        out: The calibration; its suffix selects the format.
        notes: Stored in the calibration, if its format supports that.
        picture: PNG file and what it shows.
        report: JSON file and what it says.

    Raises:
        InputError: A file cannot be written.
    """
    others = {picture[0]: png(picture[1]), report[0]: as_json(report[1]).encode()}
    with ExitStack() as complete:
        for path, content in others.items():
            complete.enter_context(replacing(path)).write_bytes(content)
        write_rig(rig, out, notes=notes)
