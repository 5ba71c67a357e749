"""OpenCap's camera parameters as JSON: those of its pickles (which are not read), for one camera or
for several by name.

`intrinsicMat`, `distortion` (OpenCV's), `rotation` (3x3, world to camera, OpenCV's axes),
`translation` in mm, `imageSize` as height and width.
"""

from typing import Any

from calib.camera import Rig
from calib.documents import LARGEST_CALIBRATION, load_text, parse_json
from calib.files.fields import Source

_MATRIX = "intrinsicMat"


def is_opencap(content: dict[str, Any]) -> bool:
    """Whether the content of JSON is OpenCap's."""
    inner = (value for value in content.values() if isinstance(value, dict))
    return _MATRIX in content or any(_MATRIX in value for value in inner)


def read_opencap(source: Source) -> Rig:
    """Reads the rig.

    Raises:
        InputError: A camera is incomplete or wrong.
    """
    content: dict[str, Any] = parse_json(load_text(source.path, LARGEST_CALIBRATION), source.path)
    metres = source.metres_per_unit("mm", "OpenCap writes mm")
    named = {source.path.stem: content} if _MATRIX in content else content
    cameras = []
    for name, own in named.items():
        if not isinstance(own, dict) or _MATRIX not in own:
            continue
        size = own.get("imageSize")
        values = {
            "size": None if size is None else source.numbers(name, "imageSize", size, (2,))[::-1],
            "matrix": own[_MATRIX],
            "distortions": own.get("distortion"),
            "rotation": own.get("rotation"),
            "translation": own.get("translation"),
        }
        cameras.append(source.camera(name, values, metres))
    return source.rig(cameras)
