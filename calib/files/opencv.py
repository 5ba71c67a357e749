"""OpenCV FileStorage: YAML, XML or JSON.

Layouts that are read:

- one file with all cameras: a map per camera, named after it, beside an optional `unit` (this is
  also what is written);
- one file with one camera, its keys at the top level. A folder may hold several (`camera_folder`).

Keys, whatever their case and underscores: `camera_matrix` (or K, intrinsic_matrix, mtx),
`distortion_coefficients` (dist_coeffs, dist, D, distortions), `rotation` (R, Rot, rvec,
rotation_vector, rotation_matrix), `translation` (T, tvec, translation_vector), `image_width` and
`image_height` (or `image_size`, `size`), `fisheye`, `unit`, `name`. Rotation and translation take
the world into the camera.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files.fields import Source
from calib.files.file_storage import dump_storage, load_storage

_ALIASES = {
    "matrix": ("cameramatrix", "k", "intrinsicmatrix", "intrinsics", "mtx", "matrix"),
    "distortions": (
        *("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distortions"),
        *("distortion", "dist", "d"),
    ),
    "rotation": ("rotation", "r", "rot", "rvec", "rvecs", "rotationvector", "rotationmatrix"),
    "translation": ("translation", "t", "tvec", "tvecs", "translationvector"),
    "size": ("imagesize", "size"),
    "width": ("imagewidth", "width"),
    "height": ("imageheight", "height"),
    "fisheye": ("fisheye",),
    "unit": ("unit", "units"),
    "name": ("name", "cameraname"),
}
_KEY = {alias: key for key, aliases in _ALIASES.items() for alias in aliases}
_REMEDY = "add a top-level entry unit: m"


def read_opencv(source: Source) -> Rig:
    """Reads one file. InputError where the file is no FileStorage, or a camera in it is incomplete
    or wrong.
    """
    content = load_storage(source.path)
    maps = {
        key: value
        for key, value in content.items()
        if isinstance(value, dict) and "matrix" in _known_entries(value)
    }
    if not maps and is_opencv_camera(content):
        maps = {source.path.stem: content}
    if not maps:
        return source.rig([])
    metres = _metres(source, content, *maps.values())
    return source.rig([_camera(source, name, values, metres) for name, values in maps.items()])


def is_opencv_camera(content: dict[str, Any]) -> bool:
    """Whether the content of a file is one camera's."""
    return "matrix" in _known_entries(content)


def opencv_camera(source: Source, name: str, content: dict[str, Any]) -> Camera | None:
    """Camera of a file that is its own and states its unit. InputError where it is incomplete or
    wrong.
    """
    return _camera(source, name, content, _metres(source, content))


def write_opencv(rig: Rig, path: Path) -> None:
    """Writes one file with all cameras, in metres. InputError where a camera's name cannot be a key
    of OpenCV's; OSError where the file cannot be written.
    """
    for name in rig.names:
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", name):
            raise InputError(
                f"camera {name}: OpenCV's keys are letters, digits, - and _, starting with a"
                " letter: rename it or write TOML"
            )
    content: dict[str, Any] = {"unit": "m"}
    for camera in rig:
        content[camera.name] = {
            "image_width": camera.size[0],
            "image_height": camera.size[1],
            "fisheye": int(camera.fisheye),
            "camera_matrix": camera.matrix,
            "distortion_coefficients": (
                camera.distortion.reshape(-1, 1) if len(camera.distortion) else np.zeros((4, 1))
            ),
            "rotation": camera.rotation,
            "translation": camera.translation.reshape(3, 1),
        }
    dump_storage(content, path)


def _known_entries(content: dict[str, Any]) -> dict[str, Any]:
    """A camera's entries under this project's names; the first alias takes precedence."""
    named: dict[str, Any] = {}
    for key, value in content.items():
        name = _KEY.get(key.lower().replace("_", ""))
        if name is not None:
            named.setdefault(name, value)
    return named


def _metres(source: Source, *maps: dict[str, Any]) -> float:
    """Metres per unit, as stated in any of the maps."""
    units = [unit for values in maps if (unit := _known_entries(values).get("unit")) is not None]
    stated = sorted(set(map(str, units)))
    if len(stated) > 1:
        raise source.error(
            f"cameras in different units ({', '.join(stated)[:80]}): write them in one"
        )
    return source.metres_per_unit(units[0] if units else None, _REMEDY)


def _camera(source: Source, name: str, content: dict[str, Any], metres: float) -> Camera | None:
    """Camera from its map."""
    values = _known_entries(content)
    if "size" not in values and {"width", "height"} <= values.keys():
        values["size"] = [values["width"], values["height"]]
    fisheye = values.get("fisheye", False)
    values["fisheye"] = bool(fisheye) if isinstance(fisheye, float) else fisheye
    return source.camera(str(values.get("name", name)), values, metres)
