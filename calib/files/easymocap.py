"""EasyMocap's folder of `intri.yml` and `extri.yml` (OpenCV FileStorage).

Per camera NAME in the list `names`: `K_NAME`, `dist_NAME` and perhaps `H_NAME`, `W_NAME` (image
    size, px) in the first; `Rot_NAME` (3x3)
or `R_NAME` (Rodrigues) and `T_NAME` in the second. Neither states a unit nor, mostly, a size: a
`unit: m` entry in either file is ours, the size comes from the caller where it is missing.
"""

import re
from pathlib import Path
from typing import Any

import cv2

from calib.camera import Rig
from calib.errors import InputError
from calib.files import opencv
from calib.files.fields import Source, five_distortion_numbers

_FILES = ("intri.yml", "extri.yml")


def is_easymocap(path: Path) -> bool:
    """Whether a path is such a folder, or one of its two files."""
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
    whole = Source(folder, source.unit, source.size)
    missing = [name for name in _FILES if not (folder / name).is_file()]
    if missing:
        raise whole.error(
            f"{missing[0]} is missing: EasyMocap's calibration is {' and '.join(_FILES)}"
        )
    content = {
        key: value for name in _FILES for key, value in opencv.load(Source(folder / name)).items()
    }
    names = content.get("names")
    if not isinstance(names, list) or not names:
        raise whole.error("names is missing: a list of the cameras' names")
    metres = whole.metres_per_unit(content.get("unit"), "add an entry unit: m to extri.yml")
    cameras = []
    for number_or_name in names:
        name = (
            str(int(number_or_name)) if isinstance(number_or_name, float) else str(number_or_name)
        )

        def of(key: str, name: str = name) -> Any:
            return content.get(f"{key}_{name}")

        values = {
            "size": None if of("W") is None or of("H") is None else [of("W"), of("H")],
            "matrix": of("K"),
            "distortions": of("dist"),
            "rotation": of("R") if of("Rot") is None else of("Rot"),
            "translation": of("T"),
        }
        cameras.append(whole.camera(name, values, metres))
    return whole.rig(cameras)


def write_easymocap(rig: Rig, path: Path) -> None:
    """Writes the folder, in metres.

    Raises:
        InputError: A camera's lens or name has no place in these files.
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
