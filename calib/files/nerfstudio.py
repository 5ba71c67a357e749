"""nerfstudio's `transforms.json`, as instant-ngp's.

`transform_matrix` (4x4, or its first three rows) takes the camera into the world; the camera's axes
are OpenGL's, x right, y up, z backward, and OpenCV's are turned by diag(1, -1, -1). The image
begins at the corner of its first pixel, as COLMAP's, from which these numbers come. Lens entries
stand at the top or with each frame. Lengths have no unit: the caller states it. Cameras are named
after their pictures. Read are OPENCV, PINHOLE, SIMPLE_PINHOLE and OPENCV_FISHEYE.
"""

from typing import Any

import numpy as np

from calib.camera import Rig
from calib.documents import LARGEST_CALIBRATION, load_text, parse_json
from calib.files.fields import Source, brief, names_of_pictures

_FLIP = np.diag([1, -1, -1])
_MODELS = {"OPENCV": False, "PINHOLE": False, "SIMPLE_PINHOLE": False, "OPENCV_FISHEYE": True}


def read_nerfstudio(source: Source) -> Rig:
    """Reads the rig.

    Raises:
        InputError: A frame is incomplete or wrong, or its lens is none of OpenCV's.
    """
    content: dict[str, Any] = parse_json(load_text(source.path, LARGEST_CALIBRATION), source.path)
    frames = content["frames"]
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise source.error("frames must be a list of objects with file_path and transform_matrix")
    metres = source.metres_per_unit(
        None, "nerfstudio's have none: scale transform_matrix to a known length first"
    )
    pictures = [str(frame.get("file_path", number)) for number, frame in enumerate(frames)]
    cameras = []
    for name, frame in zip(names_of_pictures(pictures), frames, strict=True):
        own = {**content, **frame}
        values = _lens(source, name, own)
        if own.get("transform_matrix") is not None:
            pose = source.numbers(name, "transform_matrix", own["transform_matrix"])
            if pose.size not in (12, 16):
                raise source.error("transform_matrix must be 4x4 numbers", name)
            world_from_camera = pose[:12].reshape(3, 4)
            rotation = source.rotation(name, _FLIP @ world_from_camera[:, :3].T)
            values["rotation"] = rotation
            values["translation"] = -rotation @ world_from_camera[:, 3]
        cameras.append(source.camera(name, values, metres))
    return source.rig(cameras)


def _lens(source: Source, name: str, own: dict[str, Any]) -> dict[str, Any]:
    """Size and lens of a frame."""
    model = own.get("camera_model", "OPENCV_FISHEYE" if own.get("is_fisheye") else "OPENCV")
    if model not in list(_MODELS):
        raise source.error(
            f"lens model {brief(model)} is not read: undistort, or use {', '.join(_MODELS)}", name
        )
    fisheye = _MODELS[model]
    if not fisheye and own.get("k4"):
        # nerfstudio's k4 is a fourth radial term, OpenCV's the first below the fraction line.
        raise source.error("k4 is no term of OpenCV's: fit the lens with k1, k2, k3 alone", name)
    size = [own["w"], own["h"]] if {"w", "h"} <= own.keys() else None
    focal = {"fx": own.get("fl_x"), "fy": own.get("fl_y", own.get("fl_x"))}
    return source.lens(name, {**own, **focal}, fisheye, first_pixel=0.5) | {"size": size}
