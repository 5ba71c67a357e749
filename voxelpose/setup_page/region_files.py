"""regions/CAMERA.png with the polygons it was drawn from, so that their corners can be moved later.

The picture alone decides: polygons count only where they paint exactly what it shows.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin

from calib.atomic import unwritable, write_whole
from calib.errors import InputError
from voxelpose.recording.folder import pictures_by_camera
from voxelpose.recording.unknown_places import painted_mask
from voxelpose.setup_page.page_requests import Polygon, Polygons, RegionDrawing

_KEY = "voxelpose polygons"


@dataclass(frozen=True, eq=False)
class RegionFile:
    """The region of a camera as its file has it.

    Attributes:
        mask: (H, W) bool, where the person may be.
        polygons: what it was drawn from, px; empty where it was painted.
    """

    path: Path
    mask: NDArray[np.bool_]
    polygons: list[Polygon]

    @property
    def painted(self) -> bool:
        """Whether the file is no drawing of polygons alone."""
        return not self.polygons


def read_regions(folder: Path, masks: Mapping[str, NDArray[np.bool_]]) -> dict[str, RegionFile]:
    """The region files of a recording, by camera name, as are the masks of `Recording.regions`, (H,
    W) bool.
    """
    paths, files = pictures_by_camera(folder / "regions", stills=True), {}
    for name, mask in masks.items():
        polygons = _stored_polygons(paths[name])
        if not np.array_equal(painted_mask(polygons, mask.shape[::-1]), mask):
            polygons = []
        files[name] = RegionFile(paths[name], mask, polygons)
    return files


def drawn_region(
    drawing: RegionDrawing, file: RegionFile | None, size: tuple[int, int]
) -> NDArray[np.bool_] | None:
    """Where the person may be, (H, W) bool, by a drawing; None: everywhere.

    Args:
        drawing: of one camera.
        file: its present file.
        size: width and height in px.
    """
    mask = painted_mask(drawing.polygons, size) if drawing.polygons else None
    if drawing.painted and file is not None and file.painted:
        mask = file.mask if mask is None else mask | file.mask
    return mask


def write_region(
    folder: Path, name: str, drawing: RegionDrawing, file: RegionFile | None, size: tuple[int, int]
) -> tuple[list[Path], list[Path]]:
    """Writes the region of a camera; returns the files that were written and removed.

    Args:
        drawing: its region.
        file: its present file.
        size: width and height in px.

    Raises:
        InputError: the region leaves nothing, or the system refuses.
    """
    if file is not None and file.path.is_dir():
        raise InputError(f"{file.path} is a folder: replace it by {name}.png, then draw")
    mask = drawn_region(drawing, file, size)
    if mask is not None and not mask.any():
        raise InputError(f"the region of {name} is outside of its picture: draw it within")
    path = folder / "regions" / f"{name}.png"
    written, removed = [], []
    if mask is not None:
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise unwritable(path, error) from error
        write_whole(path, _png(mask, drawing.polygons))
        written.append(path)
    if file is not None and file.path not in written:
        try:
            file.path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{file.path} cannot be removed: {error.strerror or error}") from error
        removed.append(file.path)
    return written, removed


def _png(mask: NDArray[np.bool_], polygons: list[Polygon]) -> bytes:
    notes = PngImagePlugin.PngInfo()
    notes.add_text(_KEY, msgspec.json.encode(polygons).decode())
    file = io.BytesIO()
    Image.fromarray(mask.view(np.uint8) * np.uint8(255)).save(file, "PNG", pnginfo=notes)
    return file.getvalue()


def _stored_polygons(path: Path) -> list[Polygon]:
    """Polygons in the notes of a PNG; none where they are not there or not understood."""
    if path.suffix.lower() != ".png" or not path.is_file():
        return []
    try:
        with Image.open(path) as image:
            text = getattr(image, "text", {}).get(_KEY, "")
        return msgspec.json.decode(text, type=Polygons)
    except (OSError, ValueError, SyntaxError, msgspec.DecodeError):
        return []
