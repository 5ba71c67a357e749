"""A folder with one file per camera: `cam_1.xml`, `cam_2.xml` ... (named after the file), or
`cam_1/config.xml` ... (after the folder): OpenCV's, OpenCap's or Kinect's JSON, or DANNCE's.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from calib.camera import Camera, Rig
from calib.files.dannce import dannce_camera, is_dannce_camera, is_matlab, load_dannce
from calib.files.fields import Source
from calib.files.file_storage import load_storage
from calib.files.foreign_json import OPENCAP_MATRIX, is_kinect, kinect_camera, opencap_camera
from calib.files.opencv import is_opencv_camera, opencv_camera
from calib.storage.documents import visible_entries

_SUFFIXES = {".yml", ".yaml", ".xml", ".json", ".mat"}


def read_camera_folder(source: Source) -> Rig:
    """Reads a folder. InputError where there is no calibration in it, or a camera is incomplete or
    wrong.
    """
    cameras: list[Camera | None] = []
    for entry in visible_entries(source.path):
        files = [entry] if entry.is_file() else visible_entries(entry)
        files = [file for file in files if file.suffix.lower() in _SUFFIXES]
        contents = {file: load_storage(file) for file in files if _is_storage(file)}
        contents |= {file: load_dannce(Source(file)) for file in files if is_matlab(file)}
        readers = {file: reader for file in contents if (reader := _reader_of(contents[file]))}
        if entry.is_dir() and len(readers) > 1:
            raise Source(entry).error(
                f"{len(readers)} calibrations in one camera's folder: keep"
                f" {next(iter(readers)).name} or the other"
            )
        name = entry.stem if entry.is_file() else entry.name
        for file, reader in readers.items():
            cameras.append(reader(replace(source, path=file), name, contents[file]))
    return source.rig(cameras)


def _is_storage(path: Path) -> bool:
    """Whether a file looks like a FileStorage rather than other YAML, XML or JSON."""
    with path.open("rb") as file:
        start = file.read(1000).lstrip()
    return (
        start.startswith(b"%YAML")
        or b"<opencv_storage" in start
        or (start.startswith(b"{") and path.suffix.lower() == ".json")
    )


def _reader_of(
    content: dict[str, Any],
) -> Callable[[Source, str, dict[str, Any]], Camera | None] | None:
    """What makes a camera of the content of a file that is its own; None for other files."""
    if is_kinect(content):
        return kinect_camera
    if OPENCAP_MATRIX in content:
        return opencap_camera
    if is_dannce_camera(content):
        return dannce_camera
    return opencv_camera if is_opencv_camera(content) else None
