"""Agisoft Metashape's cameras, exported as XML.

A camera's `transform` takes the camera, whose axes are OpenCV's, into the chunk, and the transform
of its component or chunk into the world. The lens of a `frame` sensor is Brown's, in pixels: `cx`
and `cy` count from the image's middle, B1 and B2 are a difference of the focal lengths and a skew,
P1 and P2 are exchanged against OpenCV's. A `fisheye` is OpenCV's without P1 and P2. Lengths are
metres only where markers, scale bars or positions were given, which the file does not tell: the
caller states the unit. Cameras are named by their labels; those that are not aligned have no
position. Source: Metashape Professional user manual, appendix "Camera models".
"""

from typing import Any
from xml.etree import ElementTree

import numpy as np

from calib.camera import FloatArray, Rig
from calib.files.fields import Source, brief, names_of_pictures
from calib.storage.documents import load_text, parse_xml

_FISHEYES = ("fisheye", "equidistant_fisheye")


def read_metashape(source: Source) -> Rig:
    """Reads the rig. InputError where it holds other than one chunk, or a camera in it is
    incomplete or wrong.
    """
    root = parse_xml(load_text(source.path), source.path)
    chunks = root.findall("chunk")
    if len(chunks) != 1:
        raise source.error(f"holds {len(chunks)} chunks: export the cameras of one")
    chunk = chunks[0]
    sensors = {sensor.get("id"): sensor for sensor in chunk.iter("sensor")}
    components = {part.get("id"): part.find("transform") for part in chunk.iter("component")}
    metres = source.metres_per_unit(
        None, "Metashape's are metres only with scale bars or known positions: check one"
    )
    elements = chunk.findall("cameras//camera")
    names = names_of_pictures([camera.get("label", "") for camera in elements])
    cameras = []
    for name, camera in zip(names, elements, strict=True):
        values = _lens(source, name, sensors.get(camera.get("sensor_id")))
        world = components.get(camera.get("component_id"))
        world = chunk.find("transform") if world is None else world
        text = camera.findtext("transform")
        if text is not None:
            pose = source.numbers(name, "transform", text.split(), (16,)).reshape(4, 4)
            rotation, centre = _in_world(source, name, world, pose)
            values |= {"rotation": rotation, "translation": -rotation @ centre}
        cameras.append(source.camera(name, values, metres))
    return source.rig(cameras)


def _in_world(
    source: Source, name: str, world: ElementTree.Element | None, pose: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) of the world into the camera, and the camera's centre (3,) in it."""
    turn, shift, scale = np.eye(3), np.zeros(3), 1.0
    if world is not None:
        if (text := world.findtext("rotation")) is not None:
            turn = source.rotation(name, text.split())
        if (text := world.findtext("translation")) is not None:
            shift = source.numbers(name, "translation", text.split(), (3,))
        if (text := world.findtext("scale")) is not None:
            scale = source.numbers(name, "scale", text, (1,))[0]
    rotation = source.rotation(name, pose[:3, :3].T)
    return rotation @ turn.T, scale * turn @ pose[:3, 3] + shift


def _lens(source: Source, name: str, sensor: ElementTree.Element | None) -> dict[str, Any]:
    """Size and lens of a camera's sensor."""
    lenses = [] if sensor is None else sensor.findall("calibration")
    lens = next((one for one in lenses if one.get("class") == "adjusted"), next(iter(lenses), None))
    if lens is None:
        raise source.error("its sensor has no calibration: optimise the cameras, then export", name)
    kind = lens.get("type", "frame")
    texts = {child.tag.lower(): child.text for child in lens}
    term = {
        key: source.numbers(name, key, texts.get(key) or 0, (1,))[0]
        for key in "f cx cy b1 b2 k1 k2 k3 k4 p1 p2 p3 p4".split()
    }
    fisheye = kind in _FISHEYES
    strange = ("p1", "p2", "p3", "p4", "b2") if fisheye else ("k4", "p3", "p4")
    if (kind != "frame" and not fisheye) or any(term[key] for key in strange):
        listed = ", ".join(strange)
        raise source.error(
            f"a {brief(kind)} lens with {listed} is not read: use frame or fisheye, and optimise"
            f" without {listed}",
            name,
        )
    picture = lens.find("resolution")
    size = None if picture is None else [picture.get("width"), picture.get("height")]
    width, height = source.image_size(name, size)
    numbers = {
        **term,
        "fx": term["f"] + term["b1"],
        "fy": term["f"],
        "skew": term["b2"],
        "cx": width / 2 + term["cx"],
        "cy": height / 2 + term["cy"],
        "p1": term["p2"],
        "p2": term["p1"],
    }
    return source.lens(name, numbers, fisheye) | {"size": (width, height)}
