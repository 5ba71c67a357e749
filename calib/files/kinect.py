"""Azure Kinect's factory calibration, the JSON of its raw calibration and of its MKV files; and
Open3D's `intrinsic.json`, made of them.

It holds the lens of the colour camera and no position in a room: it serves `--intrinsics`. Numbers
are shares of the full 4:3 sensor, from the corner of the first pixel; 16:9 pictures are cut from
its middle, so that the caller states the picture's size. BrownConrady is OpenCV's rational lens.
Open3D's matrix stands column by column, in pixels, without distortion. The camera is named after
the file. Source: Azure Kinect Sensor SDK, `transformation/mode_specific_calibration.c`.
"""

from typing import Any

import numpy as np

from calib.camera import Rig
from calib.documents import LARGEST_CALIBRATION, load_text, parse_json
from calib.files.fields import Source, brief

_MODEL = "CALIBRATION_LensDistortionModelBrownConrady"
_COLOUR = "CALIBRATION_CameraPurposePhotoVideo"
_ORDER = "cx cy fx fy k1 k2 k3 k4 k5 k6 codx cody p2 p1".split()


def read_kinect(source: Source) -> Rig:
    """Reads the colour camera.

    Raises:
        InputError: It is not there, incomplete, or of another lens; or the picture's size is none
            that this sensor makes.
    """
    content: dict[str, Any] = parse_json(load_text(source.path, LARGEST_CALIBRATION), source.path)
    name = source.path.stem
    if "intrinsic_matrix" in content:
        matrix = source.numbers(name, "intrinsic_matrix", content["intrinsic_matrix"], (9,))
        size = [content.get("width"), content.get("height")]
        values = {"size": size, "matrix": matrix.reshape(3, 3).T, "distortions": []}
        return source.rig([source.camera(name, values, 1)])
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
    if lens.get("ModelType") != _MODEL:
        raise source.error(f"lens {brief(lens.get('ModelType'))} is not read: only {_MODEL}", name)
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
    values = source.lens(name, term, first_pixel=0.5) | {"size": size}
    return source.rig([source.camera(name, values, 1)])
