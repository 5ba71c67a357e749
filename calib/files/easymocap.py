"""EasyMocap's folder of `intri.yml` and `extri.yml` (OpenCV FileStorage).

Per camera NAME in the list `names`: `K_NAME`, `dist_NAME` and optionally `H_NAME`, `W_NAME` (image
size, px) in the first; `Rot_NAME` (3x3) or `R_NAME` (Rodrigues) and `T_NAME` in the second. Neither
states a unit nor, usually, a size: a `unit: m` entry in either file is ours, and a missing size is
given by the caller.
"""

import re
from pathlib import Path

import cv2

from calib.camera import Rig
from calib.errors import InputError
from calib.files import opencv
from calib.files.fields import Source, five_distortion_numbers

_FILES = ("intri.yml", "extri.yml")


def is_easymocap(path: Path) -> bool:
    """Whether a path is EasyMocap's folder or one of its two files."""
    folder = path if path.is_dir() else path.parent
    return (path.is_dir() or path.name in _FILES) and any(
        (folder / name).is_file() for name in _FILES
    )


def read_easymocap(source: Source) -> Rig:
    """Reads the rig from the folder or either file in it.

    Raises:
        InputError: A file is missing, or a camera in it is incomplete or wrong.
    """
    folder = source.path if source.path.is_dir() else source.path.parent
    folder_source = Source(folder, source.unit, source.size)
    missing = [name for name in _FILES if not (folder / name).is_file()]
    if missing:
        raise folder_source.error(
            f"{missing[0]} is missing: EasyMocap's calibration is {' and '.join(_FILES)}"
        )
    content = {
        key: value for name in _FILES for key, value in opencv.load(Source(folder / name)).items()
    }
    names = content.get("names")
    if not isinstance(names, list) or not names:
        raise folder_source.error("names is missing: a list of the cameras' names")
    metres = folder_source.metres_per_unit(content.get("unit"), "add an entry unit: m to extri.yml")
    cameras = []
    for number_or_name in names:
        name = str(int(number_or_name) if isinstance(number_or_name, float) else number_or_name)
        suffix = f"_{name}"
        own = {key.removesuffix(suffix): content[key] for key in content if key.endswith(suffix)}
        values = {
            "size": [own["W"], own["H"]] if {"W", "H"} <= own.keys() else None,
            "matrix": own.get("K"),
            "distortions": own.get("dist"),
            "rotation": own.get("Rot", own.get("R")),
            "translation": own.get("T"),
        }
        cameras.append(folder_source.camera(name, values, metres))
    return folder_source.rig(cameras)


def write_easymocap(rig: Rig, path: Path) -> None:
    """Writes the folder, in metres.

    Raises:
        InputError: A camera's lens or name cannot be stored in these files.
        OSError: The folder cannot be written.
    """
    for camera in rig:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", camera.name):
            raise InputError(
                f"camera {camera.name}: EasyMocap's names are letters, digits, - and _: rename it"
                " or write TOML"
            )
    distortions = [five_distortion_numbers(camera, "EasyMocap") for camera in rig]
    path.mkdir()
    for name in _FILES:
        storage = cv2.FileStorage(str(path / name), cv2.FILE_STORAGE_WRITE)
        storage.startWriteStruct("names", cv2.FileNode_SEQ)
        for camera in rig:
            storage.write("", camera.name)
        storage.endWriteStruct()
        for camera, distortion in zip(rig, distortions, strict=True):
            if name == _FILES[0]:
                storage.write(f"K_{camera.name}", camera.matrix)
                storage.write(f"dist_{camera.name}", distortion[None])
                storage.write(f"H_{camera.name}", camera.size[1])
                storage.write(f"W_{camera.name}", camera.size[0])
            else:
                storage.write(f"R_{camera.name}", cv2.Rodrigues(camera.rotation)[0])
                storage.write(f"Rot_{camera.name}", camera.rotation)
                storage.write(f"T_{camera.name}", camera.translation.reshape(3, 1))
        storage.write("unit", "m")
        storage.release()
