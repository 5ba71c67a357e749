"""Places of the pictures about which nothing is known: furniture or people before the person.

They are painted, unknown/CAMERA.png, or drawn as polygons in recording.toml.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import cv2
import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from calib.camera import Camera
from calib.errors import InputError
from calib.storage.documents import LARGEST_SETTINGS, load_text, parse_toml
from voxelpose.recording.frame_reader import other_size
from voxelpose.recording.masks import painted

RECORDING_FILE = "recording.toml"
_Pixel = Annotated[float, Meta(ge=-30_000, le=30_000)]
_Polygons = list[Annotated[list[tuple[_Pixel, _Pixel]], Meta(min_length=3)]]
_EXAMPLE = "cam_1 = [[[0, 300], [200, 300], [200, 480], [0, 480]]]"

UnknownMasks = dict[str, NDArray[np.bool_]]
"""(H, W) bool by camera name, where nothing is known."""


def read_painting(path: Path, camera: Camera) -> NDArray[np.bool_]:
    """What is painted (H, W) in a picture that marks places in a camera's pictures. InputError
    where it cannot be read or differs in size from the camera.
    """
    mask = painted(path)
    if mask.shape[::-1] != camera.size:
        raise other_size(path, mask.shape[::-1], camera, "paint it on a frame of the video")
    return mask


def painted_mask(polygons: Sequence[ArrayLike], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels (H, W) bool within any of the polygons, (N, 2) px each, of a picture of a size."""
    image = np.zeros(size[::-1], np.uint8)
    for polygon in polygons:
        cv2.fillPoly(image, [np.rint(np.asarray(polygon)).astype(np.int32)], 1)
    return image.view(np.bool_)


def unknown_polygons(path: Path, names: Sequence[str]) -> dict[str, list[NDArray[np.float64]]]:
    """Reads the unknown places of recording.toml, polygons (N, 2) px each, by camera name.
    InputError where the file is not TOML, a key is not known, there is no such camera, or what it
    holds are no polygons.

    Args:
        path: the file; one that does not exist lists none.
    """
    if not path.exists():
        return {}
    table = parse_toml(load_text(path, LARGEST_SETTINGS), path)
    for key in table:
        if key != "unknown":
            raise InputError(f"{path}: {key[:40]!r} is not known: use [unknown]")
    listed = table.get("unknown", {})
    if not isinstance(listed, dict):
        raise InputError(f"{path}: unknown is no table: write [unknown] and {_EXAMPLE}")
    by_camera = {}
    for name, polygons in listed.items():
        if name not in names:
            raise InputError(
                f"{path}: there is no camera {name[:40]!r}: the recording has {', '.join(names)}"
            )
        by_camera[name] = _corners(polygons, f"{path}: unknown places of {name[:40]}")
    return by_camera


def _corners(polygons: object, where: str) -> list[NDArray[np.float64]]:
    """Polygons (N, 2) of a parsed list, px."""
    try:
        return [np.array(polygon) for polygon in msgspec.convert(polygons, _Polygons)]
    except msgspec.ValidationError:
        raise InputError(
            f"{where} are no list of polygons of three or more corners, px: write {_EXAMPLE}"
        ) from None
