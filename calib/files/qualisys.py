"""Qualisys Track Manager's calibration export, `.qca.txt`, and Theia3D's, of the same tags (XML).

What QTM writes, and how it is converted:

- `transform`: the camera's position in the world in millimetres, and a rotation whose camera looks
  along -z with y up; OpenCV's rotation is diag(1, -1, -1) times it.
- `intrinsic`: focal lengths and centre in 1/64 px of the whole sensor; `fov_video` is the part of
  it that is filmed.
- distortion: k1, k2, p1, p2, k3 on normalised coordinates, as OpenCV's. They are *not* in 64ths:
  board stills of such a camera give k1 = -0.049 where its file says -0.048. (Pose2Sim divides them
  by 64; a TOML that comes from there has next to no distortion.)
- `viewrotation` rotates only QTM's own display and is ignored.

Marker cameras are left out where there are cameras that film by their model: Video, Hybrid,
colour, an Oqus with a c (210c). The unit is always mm.

Theia's root has no attributes, and its cameras no `fov_video`. There `transform` takes the world
into the camera, with OpenCV's axes, and lengths of the lens are in px. Where a pixel begins is not
said: its centre is taken, as OpenCV does. Both have the same terms of distortion. Source: "Data
formats, Calibration files" of Theia3D's documentation; a camera of a public recording stands at
2.16 m and looks at the origin by it.
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from calib.camera import Camera, FloatArray, Rig
from calib.files.fields import Source, five_distortion_numbers, video_cameras
from calib.storage.documents import load_text, parse_xml

_SUBPIXELS = 64
_FILMING = re.compile(r"video|hybrid|colou?r|\dc\b", re.IGNORECASE)
_FLIP = np.diag([1, -1, -1])
_DISTORTION = (
    *("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2"),
    "radialDistortion3",
)
_LENS = ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV")


def read_qualisys(source: Source) -> Rig:
    """Reads the rig. InputError where the file is neither QTM's nor Theia's calibration, or a
    camera in it is incomplete or wrong.
    """
    root = parse_xml(load_text(source.path), source.path)
    theia = not root.attrib
    if theia == (root.find(".//fov_video") is not None) and root.find(".//intrinsic") is not None:
        raise source.error(
            "QTM's file has attributes in its first tag and <fov_video> in each camera, Theia's has"
            " neither; they differ in the transform, and this one is of neither kind: export again"
        )
    metres = source.metres_per_unit("mm", "QTM and Theia write mm")
    elements = {
        element.get("serial") or f"cam_{number}": element
        for number, element in enumerate(root.iter("camera"), start=1)
    }
    kinds = {
        name: element.get("model", "")
        for name, element in elements.items()
        if element.get("active", "1") != "0" and element.get("calibrated", "true") != "false"
    }
    filming = [name for name, kind in kinds.items() if _FILMING.search(kind) or kind == "none"]
    names, notes = video_cameras(source, kinds, filming, elements.keys() - kinds.keys())
    camera = _theia_camera if theia else _camera
    return source.rig([camera(source, name, elements[name], metres) for name in names], notes)


def write_qualisys(rig: Rig, path: Path) -> None:
    """Writes the rig, in QTM's units. InputError where a camera's lens has terms that QTM does not
    know.
    """
    root = ElementTree.Element("calibration", {"type": "regular"})
    cameras = ElementTree.SubElement(root, "cameras")
    for camera in rig:
        distortion = five_distortion_numbers(camera, "a Qualisys file")
        width, height = camera.size
        element = ElementTree.SubElement(
            cameras,
            "camera",
            {"active": "1", "model": "none", "serial": camera.name, "viewrotation": "0"},
        )
        full_frame = {"left": "0", "top": "0", "right": str(width - 1), "bottom": str(height - 1)}
        for key in ("fov_marker", "fov_marker_max", "fov_video", "fov_video_max"):
            ElementTree.SubElement(element, key, full_frame)
        rotation = _FLIP @ camera.rotation
        position = dict(zip("xyz", map(_text, 1000 * camera.center_m), strict=True))
        ElementTree.SubElement(
            element,
            "transform",
            position
            | {f"r{i + 1}{j + 1}": _text(rotation[i, j]) for i in range(3) for j in range(3)},
        )
        numbers = {
            "focalLengthU": _SUBPIXELS * camera.matrix[0, 0],
            "focalLengthV": _SUBPIXELS * camera.matrix[1, 1],
            "centerPointU": _SUBPIXELS * camera.matrix[0, 2],
            "centerPointV": _SUBPIXELS * camera.matrix[1, 2],
            "skew": _SUBPIXELS * camera.matrix[0, 1],
            "sensorMinU": 0,
            "sensorMaxU": _SUBPIXELS * (width - 1),
            "sensorMinV": 0,
            "sensorMaxV": _SUBPIXELS * (height - 1),
        } | dict(zip(_DISTORTION, distortion, strict=True))
        ElementTree.SubElement(
            element, "intrinsic", {key: _text(value) for key, value in numbers.items()}
        )
    ElementTree.indent(root)
    path.write_bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


def _camera(
    source: Source, name: str, element: ElementTree.Element, metres: float
) -> Camera | None:
    """Camera from QTM's element."""
    fields = _Fields(source, name, element)
    left, top, right, bottom = fields.numbers("fov_video", ("left", "top", "right", "bottom"))
    size = source.image_size(name, (right - left + 1, bottom - top + 1))
    resolution = element.get("video_resolution", "")
    if (
        re.fullmatch(r"[0-9]{1,6}.", resolution)
        and not 0.9 < int(resolution[:-1]) / min(size) < 1.1
    ):
        raise source.error(
            f"filmed at {resolution} but calibrated at {min(size):.0f} lines: record at full"
            " resolution or write a TOML",
            name,
        )
    matrix = fields.matrix()
    matrix[:2] /= _SUBPIXELS
    matrix[:2, 2] -= left, top
    rotation, position = fields.transform()
    rotation = _FLIP @ rotation
    return fields.camera(size, matrix, rotation, -rotation @ position, metres)


def _theia_camera(
    source: Source, name: str, element: ElementTree.Element, metres: float
) -> Camera | None:
    """Camera from Theia's element."""
    fields = _Fields(source, name, element)
    first_u, last_u, first_v, last_v = fields.numbers(
        "intrinsic", ("sensorMinU", "sensorMaxU", "sensorMinV", "sensorMaxV")
    )
    # The last pixel, or the first one beyond: sides of videos are even.
    size = source.image_size(name, 2 * np.ceil([(last_u - first_u) / 2, (last_v - first_v) / 2]))
    matrix = fields.matrix()
    matrix[:2, 2] -= first_u, first_v
    return fields.camera(size, matrix, *fields.transform(), metres)


class _Fields(NamedTuple):
    """Numbers of a camera's element, as they stand there, and the camera of what they became."""

    source: Source
    name: str
    element: ElementTree.Element

    def numbers(self, tag: str, keys: Iterable[str], missing: str | None = None) -> FloatArray:
        """Attributes of a child; "tangential" is spelled in more than one way."""
        child = self.element.find(tag)
        if child is None:
            raise self.source.error(f"<{tag}> is missing: export the calibration again", self.name)
        texts = {re.sub("^t[ae]ngenti?al", "tangental", key): text for key, text in child.items()}
        values = (self.source.numbers(self.name, k, texts.get(k, missing), (1,))[0] for k in keys)
        return np.array(list(values))

    def matrix(self) -> FloatArray:
        """Lens (3, 3) of the whole sensor, in the file's unit, with 1 in the corner."""
        fu, fv, cu, cv = self.numbers("intrinsic", _LENS)
        (skew,) = self.numbers("intrinsic", ("skew",), missing="0")
        return np.array([[fu, skew, cu], [0, fv, cv], [0, 0, 1]])

    def transform(self) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and the vector (3,)."""
        keys = (f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
        rotation = self.source.rotation(self.name, self.numbers("transform", keys))
        return rotation, self.numbers("transform", "xyz")

    def camera(
        self,
        size: tuple[int, int],
        matrix: FloatArray,
        rotation: FloatArray,
        translation: FloatArray,
        metres: float,
    ) -> Camera | None:
        """Camera with the distortion of the element."""
        values = {
            "size": size,
            "matrix": matrix,
            "distortions": self.numbers("intrinsic", _DISTORTION, missing="0"),
            "rotation": rotation,
            "translation": translation,
        }
        return self.source.camera(self.name, values, metres)


def _text(value: float) -> str:
    """A number with all its digits."""
    return repr(float(value))
