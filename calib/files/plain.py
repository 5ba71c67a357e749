"""JSON: cameras as in the TOML layout, or a list of 3x4 projection matrices.

Cameras, for scripts: `{"unit": "m", "cameras": [{...}, ...]}` with the keys of the TOML layout and
the rotation as a matrix.

Matrices: `{"unit": "m", "projections": [[[...4], [...4], [...4]], ...]}`, or the bare list.
Optional lists with one entry per matrix: `names` (else cam_0, cam_1 ...) and `sizes` as [w, h] (or
one `size` for all); otherwise the caller gives the size. A matrix is decomposed into K, R and t,
including the skew, so that K [R | t] equals the given matrix up to scale. Its sign is arbitrary: a
matrix and its negative are the same camera; it is chosen such that det(K R) > 0.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy import linalg

from calib.camera import FloatArray, Rig
from calib.errors import InputError
from calib.files.fields import Source, camera_values
from calib.storage.documents import load_text, parse_json


def read_json(source: Source) -> Rig:
    """Reads the rig; `cameras` may also be a map from names to cameras. InputError where a camera
    is incomplete or wrong.
    """
    content: dict[str, Any] = parse_json(load_text(source.path), source.path)
    cameras = content["cameras"]
    listed = cameras if isinstance(cameras, list) else []
    named = [*(cameras.items() if isinstance(cameras, dict) else enumerate(listed))]
    if not all(isinstance(values, dict) for _, values in named):
        raise source.error(
            "cameras must be a list of objects with name, size, matrix, distortions, rotation and"
            " translation"
        )
    metres = source.metres_per_unit(content.get("unit"), 'add "unit": "m"')
    return source.rig(
        [source.camera(str(values.get("name", key)), values, metres) for key, values in named]
    )


def write_json(rig: Rig, path: Path) -> None:
    """Writes the rig in metres."""
    content = {"unit": "m", "cameras": [camera_values(camera) for camera in rig]}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def decompose(projection: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""RQ decomposition of a projection matrix (3, 4), homogeneous pixels from world, of any scale
    and sign. ValueError where the left 3x3 part is singular: the camera is not at a finite
    position.

    .. math:: P \sim K \, [R \mid t]

    Returns:
        Matrix K (3, 3) with a positive diagonal and 1 in the corner, rotation R (3, 3), translation
        t (3,) in the world's unit.

    Source: Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2nd ed., 6.2.4.
    """
    left = projection[:, :3]
    scale = float(np.linalg.norm(left[2]))
    if (
        not np.isfinite(projection).all()
        or scale == 0
        or abs(np.linalg.det(left / scale)) < 1e-9 * np.linalg.norm(left / scale) ** 3
    ):
        raise ValueError("the left 3x3 part is singular")
    scaled = projection / (scale * np.sign(np.linalg.det(left)))
    upper, rotation = linalg.rq(scaled[:, :3])
    signs = np.diag(np.sign(np.diag(upper)))
    upper, rotation = np.triu(upper @ signs), signs @ rotation
    translation = np.linalg.solve(upper, scaled[:, 3])
    return np.triu(upper / upper[2, 2]) + 0.0, rotation, translation  # + 0.0: no negative zeros


def read_projections(source: Source) -> Rig:
    """Reads the rig. InputError where a matrix is not 3x4, not finite or singular, or sizes or the
    unit are unknown.
    """
    content: Any = parse_json(load_text(source.path), source.path)
    content = {"projections": content} if isinstance(content, list) else content
    matrices = content["projections"]
    if not isinstance(matrices, list):
        raise source.error("projections must be a list of 3x4 matrices")
    count = len(matrices)
    names = _entries(source, content, "names", count) or [f"cam_{k}" for k in range(count)]
    sizes = _entries(source, content, "sizes", count) or [content.get("size")] * count
    metres = source.metres_per_unit(content.get("unit"), 'add "unit": "m"')
    cameras = []
    for name, size, values in zip(names, sizes, matrices, strict=True):
        projection = source.numbers(str(name), "projection", values, (3, 4))
        try:
            matrix, rotation, translation = decompose(projection)
        except ValueError as error:
            raise source.error(
                f"projection is no camera ({error}): check the matrix", str(name)
            ) from None
        decomposed = {
            "size": size,
            "matrix": matrix,
            "distortions": [],
            "rotation": rotation,
            "translation": translation,
        }
        cameras.append(source.camera(str(name), decomposed, metres))
    return source.rig(cameras)


def write_projections(rig: Rig, path: Path) -> None:
    """Writes the rig in metres. InputError where a camera has lens distortion, which a matrix
    cannot hold.
    """
    bent = [camera.name for camera in rig if not camera.is_pinhole]
    if bent:
        raise InputError(
            f"{', '.join(bent)}: a 3x4 matrix cannot hold lens distortion: write TOML, or undistort"
            " the images first"
        )
    content = {
        "unit": "m",
        "names": list(rig.names),
        "sizes": [list(camera.size) for camera in rig],
        "projections": [camera.projection.tolist() for camera in rig],
    }
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _entries(source: Source, content: dict[str, Any], key: str, count: int) -> list[Any] | None:
    """Optional list with one entry per matrix."""
    value = content.get(key)
    if value is not None and (not isinstance(value, list) or len(value) != count):
        raise source.error(f"{key} must be a list of {count}, one for each projection")
    return value
