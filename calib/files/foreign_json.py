"""JSON of other programs: nerfstudio, OpenCap and Azure Kinect.

nerfstudio's `transforms.json`, as instant-ngp's.

`transform_matrix` (4x4, or its first three rows) takes the camera into the world; the camera's axes
are OpenGL's, x right, y up, z backward, and OpenCV's are turned by diag(1, -1, -1). The image
begins at the corner of its first pixel, as COLMAP's, from which these numbers come. Lens entries
stand at the top or with each frame. Lengths have no unit: the caller states it. Cameras are named
after their pictures. Read are OPENCV, PINHOLE, SIMPLE_PINHOLE and OPENCV_FISHEYE.

OpenCap's camera parameters as JSON: those of its pickles (which are not read), for one camera or
for several by name.

`intrinsicMat`, `distortion` (OpenCV's), `rotation` (3x3, world to camera, OpenCV's axes),
`translation` in mm, `imageSize` as height and width.

Azure Kinect's factory calibration, the JSON of its raw calibration and of its MKV files; and
Open3D's `intrinsic.json`, made of them.

It holds the lens of the colour camera and no position in a room: it serves `--intrinsics`. Numbers
are shares of the full 4:3 sensor, from the corner of the first pixel; 16:9 pictures are cut from
its middle, so that the caller states the picture's size. BrownConrady is OpenCV's rational lens.
Open3D's matrix stands column by column, in pixels, without distortion. The camera is named after
the file. Source: Azure Kinect Sensor SDK, `transformation/mode_specific_calibration.c`.
"""

from typing import Any

import numpy as np

from calib.camera import Camera, Rig
from calib.files.fields import Source, brief, names_of_pictures
from calib.storage.documents import load_text, parse_json

_FLIP = np.diag([1, -1, -1])
_NERF_MODELS = {"OPENCV": False, "PINHOLE": False, "SIMPLE_PINHOLE": False, "OPENCV_FISHEYE": True}
OPENCAP_MATRIX = "intrinsicMat"
"""Key by which a camera's map of OpenCap's is known."""
_KINECT_MODEL = "CALIBRATION_LensDistortionModelBrownConrady"
_COLOUR = "CALIBRATION_CameraPurposePhotoVideo"
_ORDER = "cx cy fx fy k1 k2 k3 k4 k5 k6 codx cody p2 p1".split()


def read_nerfstudio(source: Source) -> Rig:
    """Reads the rig. InputError where a frame is incomplete or wrong, or its lens is none of
    OpenCV's.
    """
    content: dict[str, Any] = parse_json(load_text(source.path), source.path)
    frames = content["frames"]
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise source.error("frames must be a list of objects with file_path and transform_matrix")
    metres = source.metres_per_unit(
        None, "nerfstudio's have none: scale transform_matrix to a known length first"
    )
    pictures = [str(frame.get("file_path", number)) for number, frame in enumerate(frames)]
    cameras = []
    for name, frame in zip(names_of_pictures(pictures), frames, strict=True):
        fields = {**content, **frame}
        values = _frame_lens(source, name, fields)
        if fields.get("transform_matrix") is not None:
            pose = source.numbers(name, "transform_matrix", fields["transform_matrix"])
            if pose.size not in (12, 16):
                raise source.error("transform_matrix must be 4x4 numbers", name)
            world_from_camera = pose[:12].reshape(3, 4)
            rotation = source.rotation(name, _FLIP @ world_from_camera[:, :3].T)
            values["rotation"] = rotation
            values["translation"] = -rotation @ world_from_camera[:, 3]
        cameras.append(source.camera(name, values, metres))
    return source.rig(cameras)


def _frame_lens(source: Source, name: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Size and lens of a frame."""
    model = fields.get("camera_model", "OPENCV_FISHEYE" if fields.get("is_fisheye") else "OPENCV")
    if model not in list(_NERF_MODELS):
        raise source.error(
            f"lens model {brief(model)} is not read: undistort, or use {', '.join(_NERF_MODELS)}",
            name,
        )
    fisheye = _NERF_MODELS[model]
    if not fisheye and fields.get("k4"):
        # nerfstudio's k4 is a fourth radial term, OpenCV's the first below the fraction line.
        raise source.error("k4 is no term of OpenCV's: fit the lens with k1, k2, k3 alone", name)
    size = [fields["w"], fields["h"]] if {"w", "h"} <= fields.keys() else None
    focal = {"fx": fields.get("fl_x"), "fy": fields.get("fl_y", fields.get("fl_x"))}
    return source.lens(name, {**fields, **focal}, fisheye) | {"size": size}


def is_opencap(content: dict[str, Any]) -> bool:
    """Whether the content of JSON is OpenCap's, of one camera or of several."""
    inner = (value for value in content.values() if isinstance(value, dict))
    return OPENCAP_MATRIX in content or any(OPENCAP_MATRIX in value for value in inner)


def read_opencap(source: Source) -> Rig:
    """Reads the rig. InputError where a camera is incomplete or wrong."""
    content: dict[str, Any] = parse_json(load_text(source.path), source.path)
    named = {source.path.stem: content} if OPENCAP_MATRIX in content else content
    return source.rig(
        [
            opencap_camera(source, name, fields)
            for name, fields in named.items()
            if isinstance(fields, dict) and OPENCAP_MATRIX in fields
        ]
    )


def opencap_camera(source: Source, name: str, fields: dict[str, Any]) -> Camera | None:
    """Camera from its map. InputError where it is incomplete or wrong."""
    size = fields.get("imageSize")
    values = {
        "size": None if size is None else source.numbers(name, "imageSize", size, (2,))[::-1],
        "matrix": fields.get(OPENCAP_MATRIX),
        "distortions": fields.get("distortion"),
        "rotation": fields.get("rotation"),
        "translation": fields.get("translation"),
    }
    return source.camera(name, values, source.metres_per_unit("mm", "OpenCap writes mm"))


def is_kinect(content: dict[str, Any]) -> bool:
    """Whether the content of JSON is Azure Kinect's, or Open3D's."""
    plain = isinstance(content.get("intrinsic_matrix"), list)
    return "CalibrationInformation" in content or (plain and {"width", "height"} <= content.keys())


def read_kinect(source: Source) -> Rig:
    """Reads the colour camera. InputError where it is not there, incomplete, or of another lens; or
    the picture's size is none that this sensor makes.
    """
    content: dict[str, Any] = parse_json(load_text(source.path), source.path)
    return source.rig([kinect_camera(source, source.path.stem, content)])


def kinect_camera(source: Source, name: str, content: dict[str, Any]) -> Camera | None:
    """Colour camera from the content of its JSON. InputError as of `read_kinect`."""
    if "intrinsic_matrix" in content:
        matrix = source.numbers(name, "intrinsic_matrix", content["intrinsic_matrix"], (9,))
        size = [content.get("width"), content.get("height")]
        values = {"size": size, "matrix": matrix.reshape(3, 3).T, "distortions": []}
        return source.camera(name, values, 1)
    content = content["CalibrationInformation"]
    cameras = content.get("Cameras") if isinstance(content, dict) else None
    colour = [
        camera
        for camera in (cameras if isinstance(cameras, list) else ())
        if isinstance(camera, dict) and camera.get("Purpose") == _COLOUR
    ]
    if len(colour) != 1 or not isinstance(colour[0].get("Intrinsics"), dict):
        raise source.error("holds no colour camera: export the whole calibration again")
    lens = colour[0]["Intrinsics"]
    if lens.get("ModelType") != _KINECT_MODEL:
        raise source.error(
            f"lens {brief(lens.get('ModelType'))} is not read: only {_KINECT_MODEL}", name
        )
    numbers = source.numbers(name, "ModelParameters", lens.get("ModelParameters"), (14,))
    term: dict[str, float] = dict(zip(_ORDER, numbers.tolist(), strict=True))
    if term["codx"] or term["cody"]:
        raise source.error("a lens with codx and cody is none of OpenCV's", name)
    size = source.image_size(name, None)
    full = np.array([size[0], size[0] * 3 / 4])
    if 3 * size[0] != 4 * size[1] and 9 * size[0] != 16 * size[1]:
        raise source.error(
            f"a Kinect's colour picture is 4:3 or 16:9, not {size[0]} x {size[1]}", name
        )
    cut = (full[1] - size[1]) / 2
    term |= {"cx": term["cx"] * full[0], "cy": term["cy"] * full[1] - cut}
    term |= {"fx": term["fx"] * full[0], "fy": term["fy"] * full[1]}
    values = source.lens(name, term) | {"size": size}
    return source.camera(name, values, 1)
