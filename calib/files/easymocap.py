"""EasyMocap's folder of `intri.yml` and `extri.yml` (OpenCV FileStorage).

Per camera NAME in the list `names`: `K_NAME`, `dist_NAME` and optionally `H_NAME`, `W_NAME` (image
size, px) in the first; `Rot_NAME` (3x3) or `R_NAME` (Rodrigues) and `T_NAME` in the second. Neither
states a unit nor, usually, a size: a `unit: m` entry in either file is ours, and a missing size is
given by the caller.
"""

import re
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from calib.camera import Rig
from calib.errors import InputError
from calib.files.fields import Source, five_distortion_numbers, folder_with
from calib.files.file_storage import dump_storage, load_storage
from calib.rotation import rodrigues_from_matrix
from calib.storage.atomic import replacing, writing

_FILES = ("intri.yml", "extri.yml")


def is_easymocap(path: Path) -> bool:
    """Whether a path is EasyMocap's folder or one of its two files."""
    return folder_with(path, _FILES) is not None


def read_easymocap(source: Source) -> Rig:
    """Reads the rig from the folder or either file in it. InputError where a file is missing, or a
    camera in it is incomplete or wrong.
    """
    folder = folder_with(source.path, _FILES) or source.path
    folder_source = replace(source, path=folder)
    missing = [name for name in _FILES if not (folder / name).is_file()]
    if missing:
        raise folder_source.error(
            f"{missing[0]} is missing: EasyMocap's calibration is {' and '.join(_FILES)}"
        )
    content = {key: value for name in _FILES for key, value in load_storage(folder / name).items()}
    names = content.get("names")
    if not isinstance(names, list) or not names:
        raise folder_source.error("names is missing: a list of the cameras' names")
    metres = folder_source.metres_per_unit(content.get("unit"), "add an entry unit: m to extri.yml")
    cameras = []
    for number_or_name in names:
        whole = isinstance(number_or_name, float) and number_or_name.is_integer()
        name = str(int(number_or_name) if whole else number_or_name)
        suffix = f"_{name}"
        fields = {key.removesuffix(suffix): content[key] for key in content if key.endswith(suffix)}
        values = {
            "size": [fields["W"], fields["H"]] if {"W", "H"} <= fields.keys() else None,
            "matrix": fields.get("K"),
            "distortions": fields.get("dist"),
            "rotation": fields.get("Rot", fields.get("R")),
            "translation": fields.get("T"),
        }
        cameras.append(folder_source.camera(name, values, metres))
    return folder_source.rig(cameras)


def write_easymocap(rig: Rig, path: Path) -> None:
    """Writes the folder, in metres; neither file takes its name before both are complete.
    InputError where a camera's lens or name cannot be stored in these files, or they cannot be
    written.
    """
    for camera in rig:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", camera.name):
            raise InputError(
                f"camera {camera.name}: EasyMocap's names are letters, digits, - and _: rename it"
                " or write TOML"
            )
    distortions = [five_distortion_numbers(camera, "EasyMocap") for camera in rig]
    with writing(path):
        path.mkdir(exist_ok=True)
    contents: dict[Path, dict[str, Any]] = {}
    for name in _FILES:
        content: dict[str, Any] = {"names": list(rig.names)}
        for camera, distortion in zip(rig, distortions, strict=True):
            if name == _FILES[0]:
                content[f"K_{camera.name}"] = camera.matrix
                content[f"dist_{camera.name}"] = distortion[None]
                content[f"H_{camera.name}"], content[f"W_{camera.name}"] = camera.size[::-1]
            else:
                content[f"R_{camera.name}"] = rodrigues_from_matrix(camera.rotation).reshape(3, 1)
                content[f"Rot_{camera.name}"] = camera.rotation
                content[f"T_{camera.name}"] = camera.translation.reshape(3, 1)
        contents[path / name] = content | {"unit": "m"}
    with ExitStack() as complete:
        for file, content in contents.items():
            dump_storage(content, complete.enter_context(replacing(file)))
