"""COLMAP's text model: a folder of `cameras.txt` and `images.txt`.

Poses take the world into the camera, whose axes are OpenCV's, with quaternions w, x, y, z. The
image begins at the corner of its first pixel, half a pixel before its centre. A model has neither
a unit nor a vertical of its own: the caller states the unit to which it was scaled. Cameras are
named after their pictures. Every model whose lens OpenCV has is read; the others are refused.
"""

from pathlib import Path

import numpy as np

from calib.camera import Rig
from calib.files.fields import Source, brief, folder_with, names_of_pictures
from calib.storage.documents import load_text

_FILES = ("cameras.txt", "images.txt")
_BINARY = ("cameras.bin", "images.bin")
_MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}


def is_colmap(path: Path) -> bool:
    """Whether a path is the folder of a model or one of its two files."""
    return folder_with(path, (*_FILES, *_BINARY)) is not None


def read_colmap(source: Source) -> Rig:
    """Reads the rig from the folder or either file in it. InputError where a file is missing or cut
    off, or a camera is of a model without an OpenCV lens.
    """
    folder = folder_with(source.path, (*_FILES, *_BINARY)) or source.path
    for name in _FILES:
        if not (folder / name).is_file():
            raise source.error(
                f"{name} is missing: COLMAP's text model is {' and '.join(_FILES)}; `colmap"
                " model_converter --output_type TXT` makes it of a binary one"
            )
    lenses = {row[0]: row for row in _rows(folder / _FILES[0]) if row}
    # Every second line lists a picture's points, and may be empty.
    poses = _rows(folder / _FILES[1])[::2]
    if any(len(row) < 10 for row in poses):
        raise source.error("images.txt is cut off, or none of COLMAP's: export the model again")
    metres = source.metres_per_unit(
        None, "COLMAP's have none: scale the model (colmap model_aligner), then write it in metres"
    )
    names = names_of_pictures([" ".join(row[9:]) for row in poses])
    cameras = []
    for name, row in zip(names, poses, strict=True):
        values = _lens(source, name, lenses.get(row[8]))
        values["rotation"] = source.quaternion(name, row[1:5])
        values["translation"] = row[5:8]
        cameras.append(source.camera(name, values, metres))
    return source.rig(cameras)


def _lens(source: Source, name: str, row: list[str] | None) -> dict:
    """Size and lens of a camera by its row of cameras.txt."""
    if row is None or len(row) < 4:
        raise source.error("cameras.txt lacks its camera: export the model again", name)
    _, model, width, height, *parameters = row
    keys = _MODELS.get(model, "").split()
    if not keys:
        raise source.error(
            f"lens model {brief(model)} is none of OpenCV's: run COLMAP with"
            " --ImageReader.camera_model OPENCV",
            name,
        )
    if len(parameters) != len(keys):
        raise source.error(f"{model} has {len(keys)} parameters, not {len(parameters)}", name)
    numbers = dict(zip(keys, parameters, strict=True))
    lens = source.lens(name, numbers, "FISHEYE" in model)
    return lens | {"size": np.array([width, height])}


def _rows(path: Path) -> list[list[str]]:
    """Words of a file's lines, without comments; an empty line after the first stays."""
    lines = load_text(path).splitlines()
    return [line.split() for line in lines if not line.lstrip().startswith("#")]
