"""DANNCE's calibration as MATLAB's files: `*_dannce.mat` with all cameras, `params` beside their
names `camnames`; or a file for each, `hires_cam1_params.mat`.

`K`, `r` and `t` are MATLAB's of row vectors: x_cam = x_world r + t, pixels = x_cam K, so that K and
r are the transposes of OpenCV's. Pixels count from 1. `RDistort` is k1 k2 or k1 k2 k3, `TDistort`
p1 p2, as OpenCV's. Size and unit are not in the file; DANNCE itself works in mm.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from calib.camera import Camera, Rig
from calib.files.fields import Source
from calib.files.matlab import load_matlab

_CAMERA = ("K", "r", "t", "RDistort", "TDistort")


def is_matlab(path: Path) -> bool:
    """Whether a file is one of MATLAB's."""
    with suppress(OSError), path.open("rb") as file:
        return file.read(6) == b"MATLAB"
    return False


def read_dannce(source: Source) -> Rig:
    """Reads the rig. InputError where a camera is missing, incomplete or wrong, or the unit is not
    given.
    """
    content = load_dannce(source)
    if is_dannce_camera(content) or "params" not in content:
        return source.rig([dannce_camera(source, source.path.stem, content)])
    params, names = content["params"], content.get("camnames")
    cells = params if isinstance(params, list) else [params]
    cameras = [one for cell in cells for one in (cell if isinstance(cell, list) else [cell])]
    if (
        not all(isinstance(camera, dict) for camera in cameras)
        or not isinstance(names, list)
        or len(names) != len(cameras)
    ):
        raise source.error(
            f"params must be a cell array of structs ({', '.join(_CAMERA)}), camnames their names"
        )
    named = zip(map(str, names), cameras, strict=True)
    return source.rig([dannce_camera(source, name, camera) for name, camera in named])


def load_dannce(source: Source) -> dict[str, Any]:
    """Variables of a calibration of DANNCE's. InputError where the file cannot be read."""
    return load_matlab(source, (*_CAMERA, "params", "camnames"))


def is_dannce_camera(content: dict[str, Any]) -> bool:
    """Whether variables are one camera's."""
    return {*_CAMERA} <= content.keys()


def dannce_camera(source: Source, name: str, fields: dict[str, Any]) -> Camera | None:
    """Camera from its variables. InputError where it is incomplete or wrong."""
    matrix = source.numbers(name, "K", fields.get("K"), (3, 3)).T
    if matrix[2, :2].any() and not matrix[:2, 2].any():
        raise source.error("K is not transposed as MATLAB's is: write K'", name)
    radial = source.numbers(name, "RDistort", fields.get("RDistort"))
    tangential = source.numbers(name, "TDistort", fields.get("TDistort"), (2,))
    values = {
        "matrix": matrix - np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]]),
        "distortions": np.r_[radial[:2], tangential, radial[2:]],
        "rotation": source.numbers(name, "r", fields.get("r"), (3, 3)).T,
        "translation": fields.get("t"),
    }
    return source.camera(name, values, source.metres_per_unit(None, "DANNCE works in mm:"))
