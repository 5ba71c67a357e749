"""Vicon's calibration, `.xcp` (XML).

`POSITION` is the camera's centre in the world, mm; `ORIENTATION`, a quaternion x, y, z, w, takes
the world into the camera, whose axes are OpenCV's. The lens maps distorted pixels to ideal ones,
radially about a centre of its own, the other way round than OpenCV's: OpenCV's terms are fitted to
it over the picture. Video cameras are read, named by DEVICEID as the videos are; marker cameras
are left out where there are video cameras. Pixels that are not square, and lenses of other models,
are refused.
"""

import re
from xml.etree import ElementTree

import numpy as np

from calib.camera import Camera, FloatArray, Rig
from calib.files.fields import Source, brief, video_cameras
from calib.storage.documents import load_text, parse_xml

_MODEL = "Vicon3Parameter"


def read_vicon(source: Source) -> Rig:
    """Reads the rig. InputError where a camera in it is incomplete or wrong, or of a lens that
    OpenCV's cannot follow.
    """
    root = parse_xml(load_text(source.path), source.path)
    metres = source.metres_per_unit("mm", "Vicon writes mm")
    elements = {
        element.get("DEVICEID") or f"cam_{number}": element
        for number, element in enumerate(root.iter("Camera"), start=1)
    }
    kinds = {
        name: f"{element.get('TYPE', '')} {element.get('DISPLAY_TYPE', '')}".strip()
        for name, element in elements.items()
        if element.find("KeyFrames/KeyFrame") is not None
    }
    filming = [name for name, kind in kinds.items() if re.search(r"video|vue", kind, re.I)]
    names, notes = video_cameras(source, kinds, filming, elements.keys() - kinds.keys())
    return source.rig([_camera(source, name, elements[name], metres) for name in names], notes)


def _camera(
    source: Source, name: str, element: ElementTree.Element, metres: float
) -> Camera | None:
    """Camera from its element."""
    frame = element.find("KeyFrames/KeyFrame")
    entries = {} if frame is None else frame.attrib

    def numbers(key: str, count: int) -> FloatArray:
        return source.numbers(name, key, entries.get(key, element.get(key, "")).split(), (count,))

    if element.get("PIXEL_ASPECT_RATIO") and numbers("PIXEL_ASPECT_RATIO", 1)[0] != 1:
        raise source.error("its pixels are not square, which is not read: write a TOML", name)
    size = source.image_size(name, numbers("SENSOR_SIZE", 2))
    focal, centre = numbers("FOCAL_LENGTH", 1)[0], numbers("PRINCIPAL_POINT", 2)
    model, *terms = entries.get("VICON_RADIAL2", f"{_MODEL} 0 0 0 0 0").split() or [""]
    if model != _MODEL or len(terms) != 5:
        raise source.error(f"lens {brief(model)} is not read: only {_MODEL} is", name)
    bent = source.numbers(name, "VICON_RADIAL2", terms, (5,))
    rotation = source.quaternion(name, np.roll(numbers("ORIENTATION", 4), 1))
    values = {
        "size": size,
        "matrix": [[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]],
        "distortions": _opencv_terms(source, name, size, focal, centre, bent),
        "rotation": rotation,
        "translation": -rotation @ numbers("POSITION", 3),
    }
    return source.camera(name, values, metres)


def _opencv_terms(
    source: Source,
    name: str,
    size: tuple[int, int],
    focal_px: float,
    centre_px: FloatArray,
    bent: FloatArray,
) -> FloatArray:
    """OpenCV's k1 k2 p1 p2 k3 (5,) that follow Vicon's lens, by least squares over the picture."""
    if not bent[2:].any() or not focal_px:
        return np.zeros(5)
    columns, rows = (np.linspace(0, side - 1, 17) for side in size)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    offset = pixels - bent[:2]
    square = (offset**2).sum(axis=1, keepdims=True)
    with np.errstate(over="ignore", invalid="ignore"):
        ideal_px = bent[:2] + offset * (1 + square ** (1, 2, 3) @ bent[2:, None])
        ideal = (ideal_px - centre_px) / focal_px
        target = (pixels - centre_px) / focal_px - ideal
        x, y = ideal.T
        r = x * x + y * y
        terms = np.concatenate(
            [
                np.stack([x * r, x * r**2, 2 * x * y, r + 2 * x * x, x * r**3], axis=1),
                np.stack([y * r, y * r**2, r + 2 * y * y, 2 * x * y, y * r**3], axis=1),
            ]
        )
    wanted = target.T.ravel()
    if np.isfinite(terms).all() and np.isfinite(wanted).all():
        solution = np.linalg.lstsq(terms, wanted, rcond=None)[0]
        off_px = np.abs(terms @ solution - wanted).max() * focal_px
        if off_px < 0.5:
            return solution
    raise source.error(
        "its lens bends more than OpenCV's terms can follow: calibrate it with a board (`voxelpose"
        " calibrate intrinsics --model rational`)",
        name,
    )
