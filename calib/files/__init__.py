"""Calibration files: one module per format, each with a reader and a writer.

`read_rig` looks at the content, never at the name. Lengths become metres; a file that does not say
its unit is refused with a question unless the caller says it.
"""

import json
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from calib.camera import Rig
from calib.errors import InputError
from calib.files import anipose, easymocap, opencv, plain, projections, qualisys
from calib.files.fields import Source

FORMATS: dict[str, ModuleType] = {
    "anipose": anipose,
    "easymocap": easymocap,
    "json": plain,
    "opencv": opencv,
    "projections": projections,
    "qualisys": qualisys,
}
_BY_SUFFIX = {
    ".toml": "anipose",
    ".yml": "opencv",
    ".yaml": "opencv",
    ".xml": "opencv",
    ".json": "json",
    ".txt": "qualisys",
    "": "easymocap",
}


def read_rig(
    path: str | os.PathLike[str], unit: str | None = None, size: tuple[int, int] | None = None
) -> Rig:
    """Reads a calibration of any known format.

    Args: path: A file (aniposelib-layout TOML, OpenCV FileStorage, JSON with cameras or with 3x4
        matrices, Qualisys .qca.txt), or a
            folder (EasyMocap's intri.yml and extri.yml, or one OpenCV file per camera).
        unit: "m", "cm" or "mm", for a file that does not state its unit.
        size: Image (width, height), px, for a file that does not state it.

    Returns:
        The rig, in metres.

    Raises: InputError: The file is missing, of no known format, incomplete or wrong; one line says
        what and how to mend it.
    """
    source = Source(Path(path), unit, size)
    return _reader(source)(source)


def write_rig(
    rig: Rig,
    path: str | os.PathLike[str],
    style: str | None = None,
    notes: Mapping[str, Any] | None = None,
) -> None:
    """Writes a calibration, in metres and saying so; it appears whole or not at all.

    Args: rig: The cameras. path: The file. Its suffix chooses the format: .toml aniposelib layout;
        .yml, .yaml, .xml OpenCV FileStorage; .json plain
            JSON; .txt Qualisys; none EasyMocap's folder.
        style: A name from `FORMATS` where the suffix would choose another.
        notes: What else to say, kept under [metadata] in TOML; the other formats have no place for
            it.

    Raises:
        InputError: The format is unknown, cannot hold this rig, or the file cannot be written.
    """
    target = Path(path)
    if style is None:
        style = _BY_SUFFIX.get(target.suffix.lower())
        if style is None:
            raise InputError(
                f"{target}: no calibration format has the suffix {target.suffix!r}: use"
                f" {', '.join(filter(None, _BY_SUFFIX))}"
            )
    if style not in FORMATS:
        raise InputError(f"no calibration format {style!r}: choose one of {', '.join(FORMATS)}")
    # The suffix stays last because OpenCV chooses its syntax by it.
    beside = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        FORMATS[style].write(
            rig, beside, **({"notes": notes} if notes and style == "anipose" else {})
        )
        if beside.is_dir():
            target.mkdir(exist_ok=True)
            for file in beside.iterdir():
                file.replace(target / file.name)
        else:
            beside.replace(target)
    except OSError as error:
        raise InputError(f"{target}: cannot write: {error.strerror or error}") from None
    finally:
        if beside.is_dir():
            shutil.rmtree(beside)
        beside.unlink(missing_ok=True)


def _reader(source: Source) -> Callable[[Source], Rig]:
    """Chooses the reader by what the file holds."""
    if easymocap.is_easymocap(source.path):
        return easymocap.read
    if source.path.is_dir():
        return opencv.read_folder
    try:
        text = source.path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise source.error("no such calibration file") from None
    except OSError as error:
        raise source.error(f"cannot read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise source.error(
            "not a text file: expected a calibration as TOML, YAML, XML or JSON"
        ) from None
    start = text.lstrip()[:1000]
    if start.startswith("%YAML") or "<opencv_storage" in start:
        return opencv.read
    if start.startswith("<"):
        return qualisys.read
    if start[:1] in ("{", "["):
        try:
            content = json.loads(text)
        except ValueError as error:
            if start.startswith("{"):
                raise source.error(f"broken JSON: {error}") from None
        else:
            keyed = {"projections": projections.read, "cameras": plain.read}
            return (
                projections.read
                if isinstance(content, list)
                else next((keyed[key] for key in keyed if key in content), opencv.read)
            )
    return anipose.read
