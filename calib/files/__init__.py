"""Calibration files: one module per format, each with a reader and a writer.

`read_rig` recognises the format by the content, never by the name. Lengths become metres; a file
that does not state its unit is refused unless the caller states it.
"""

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from calib.camera import Rig
from calib.errors import InputError
from calib.files.anipose import read_anipose, write_anipose
from calib.files.camera_folder import read_camera_folder
from calib.files.colmap import is_colmap, read_colmap
from calib.files.dannce import is_matlab, read_dannce
from calib.files.easymocap import is_easymocap, read_easymocap, write_easymocap
from calib.files.fields import Source
from calib.files.foreign_json import (
    is_kinect,
    is_opencap,
    read_kinect,
    read_nerfstudio,
    read_opencap,
)
from calib.files.metashape import read_metashape
from calib.files.opencv import read_opencv, write_opencv
from calib.files.plain import read_json, read_projections, write_json, write_projections
from calib.files.qualisys import read_qualisys, write_qualisys
from calib.files.vicon import read_vicon
from calib.storage.atomic import replacing
from calib.storage.documents import load_text, parse_json, parse_toml


class RigFormat(NamedTuple):
    """A calibration format."""

    read: Callable[[Source], Rig]  #: Reads a file or folder of this format.
    write: Callable[..., None] | None = None
    """Writes a rig, in metres; None where the format is only read."""
    suffixes: tuple[str, ...] = ()  #: Suffixes by which `write_rig` chooses this format.


RIG_FORMATS = {
    "anipose": RigFormat(read_anipose, write_anipose, (".toml",)),
    "opencv": RigFormat(read_opencv, write_opencv, (".yml", ".yaml", ".xml")),
    "json": RigFormat(read_json, write_json, (".json",)),
    "qualisys": RigFormat(read_qualisys, write_qualisys, (".txt",)),
    "easymocap": RigFormat(read_easymocap, write_easymocap, ("",)),
    "projections": RigFormat(read_projections, write_projections),
    "colmap": RigFormat(read_colmap),
    "nerfstudio": RigFormat(read_nerfstudio),
    "metashape": RigFormat(read_metashape),
    "vicon": RigFormat(read_vicon),
    "kinect": RigFormat(read_kinect),
    "opencap": RigFormat(read_opencap),
    "dannce": RigFormat(read_dannce),
}
WRITTEN = tuple(name for name, form in RIG_FORMATS.items() if form.write is not None)
"""Names of the formats that are written."""
_READ = (
    "write its cameras as aniposelib's TOML, OpenCV's YAML or XML, JSON, Qualisys' .qca.txt or"
    " EasyMocap's folder (docs/calibration.md)"
)
_BY_SUFFIX = {suffix: name for name, form in RIG_FORMATS.items() for suffix in form.suffixes}


def read_rig(
    path: str | os.PathLike[str],
    unit: str | None = None,
    size: tuple[int, int] | None = None,
    cameras: Sequence[str] | None = None,
    lenses: bool = False,
) -> Rig:
    """Reads a calibration of any known format, in metres. InputError where the file is missing, of
    no known format, incomplete or wrong; the message is one line with the mistake and its remedy.

    Args:
        path: A file (aniposelib-layout TOML, OpenCV FileStorage, JSON with cameras or with 3x4
            matrices, nerfstudio's, OpenCap's and Kinect's JSON, Qualisys .qca.txt, Theia's, Vicon
            .xcp, Metashape's XML, DANNCE's .mat), or a folder (EasyMocap's intri.yml and extri.yml,
            COLMAP's text model, or one file of OpenCV's, OpenCap's, Kinect's or DANNCE's per
            camera).
        unit: "m", "cm" or "mm", for a file that does not state its unit.
        size: Image (width, height), px, for a file that does not state it.
        cameras: Names of the cameras that are wanted; None for all. Others may be left out of the
            rig, and are where they have a lens and no position.
        lenses: Whether lenses alone are wanted: a camera without a position stands in the origin.
    """
    source = Source(Path(path), unit, size, cameras, lenses)
    return _reader(source)(source)


def write_rig(
    rig: Rig,
    path: str | os.PathLike[str],
    style: str | None = None,
    notes: Mapping[str, Any] | None = None,
) -> None:
    """Writes a calibration in metres, with the unit stated. A failure leaves no partial file.
    InputError where the format is unknown, cannot hold this rig, or the file cannot be written.

    Args:
        path: The file. Its suffix selects the format: .toml aniposelib layout; .yml, .yaml, .xml
            OpenCV FileStorage; .json plain JSON; .txt Qualisys; none EasyMocap's folder.
        style: A name from `RIG_FORMATS`, to override the suffix.
        notes: Further entries, stored under [metadata] in TOML; the other formats drop them.
    """
    target = Path(path)
    if style is None:
        style = _BY_SUFFIX.get(target.suffix.lower())
        if style is None:
            raise InputError(
                f"{target}: no calibration format has the suffix {target.suffix!r}: use"
                f" {', '.join(filter(None, _BY_SUFFIX))}"
            )
    write = RIG_FORMATS[style].write if style in RIG_FORMATS else None
    if write is None:
        raise InputError(f"no calibration format {style!r}: choose one of {', '.join(WRITTEN)}")
    options = {"notes": notes} if notes and style == "anipose" else {}
    if style == "easymocap":  # a folder, whose files it replaces itself
        write_easymocap(rig, target)
        return
    with replacing(target) as partial:
        write(rig, partial, **options)


def _reader(source: Source) -> Callable[[Source], Rig]:
    """Returns the reader that fits the content."""
    if is_easymocap(source.path):
        return read_easymocap
    if is_colmap(source.path):
        return read_colmap
    if source.path.is_dir():
        return read_camera_folder
    if not source.path.exists():
        raise source.error("no such calibration file")
    if is_matlab(source.path):
        return read_dannce
    text = load_text(source.path, remedy=_READ)
    start = text.lstrip()[:1000]
    if start.startswith("%YAML") or "<opencv_storage" in start:
        return read_opencv
    if start.startswith("<"):
        root = re.search(r"<(?![?!])([\w.-]*)", start)
        readers = {"document": read_metashape, "Cameras": read_vicon}
        return readers.get(root[1] if root else "", read_qualisys)
    if start[:1] in ("{", "["):
        try:
            content = parse_json(text, source.path)
        except InputError:  # TOML begins with a bracket, too
            if start.startswith("{"):
                raise
        else:
            return _reader_of_json(content)
    if source.path.suffix.lower() != ".toml":
        try:
            parse_toml(text, source.path)
        except InputError:
            raise source.error(f"is of no format that is known: {_READ}") from None
    return read_anipose


def _reader_of_json(content: Any) -> Callable[[Source], Rig]:
    """Returns the reader that fits the content of JSON."""
    if isinstance(content, list):
        return read_projections
    readers = {"projections": read_projections, "cameras": read_json, "frames": read_nerfstudio}
    for key, reader in readers.items():
        if key in content:
            return reader
    if is_kinect(content):
        return read_kinect
    return read_opencap if is_opencap(content) else read_opencv
