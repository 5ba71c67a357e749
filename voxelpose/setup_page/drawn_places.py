"""Regions, unknown places and settings of `fit`: as the files of a recording have them, as drawn,
and saved.

regions/CAMERA.png keeps the polygons it was drawn from, so that their corners can be moved later.
The picture alone decides: polygons count only where they paint exactly what it shows.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomlkit
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin
from tomlkit.exceptions import TOMLKitError

from calib.errors import InputError
from calib.storage.atomic import write_whole, writing
from calib.storage.documents import load_text, parse_toml
from silhouette_core.setting_types import range_of
from voxelpose.cli.arguments import camera_names, up_direction
from voxelpose.cli.fit import Fit
from voxelpose.cli.options import checked_values, options_of
from voxelpose.recording.camera_files import pictures_by_camera
from voxelpose.recording.folder import Recording
from voxelpose.recording.unknown_places import RECORDING_FILE, painted_mask, unknown_polygons
from voxelpose.setup_page.page_requests import PlacesDrawn, Polygon, Polygons, RegionDrawing, Typed
from voxelpose.view.serving.page_answers import check_camera_names

CHOICES = "background", "tolerance", "voxel", "repair", "stature", "cameras", "up"
"""Settings of `fit` that the page shows and saves."""
_KEY = "voxelpose polygons"
_LARGEST_BYTES = 1_000_000


@dataclass(frozen=True, eq=False)
class RegionFile:
    """A camera's region file: mask (H, W) bool, and polygons, px, unless it was painted."""

    path: Path
    mask: NDArray[np.bool_]
    polygons: list[Polygon]

    @property
    def painted(self) -> bool:
        """Whether the file is no drawing of polygons alone."""
        return not self.polygons


def read_regions(folder: Path, masks: Mapping[str, NDArray[np.bool_]]) -> dict[str, RegionFile]:
    """Region files of a recording by camera name; masks as of `Recording.regions`."""
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
    """Where the person may be, (H, W) bool, by a drawing over the present file; None: all."""
    mask = painted_mask(drawing.polygons, size) if drawing.polygons else None
    if drawing.painted and file is not None and file.painted:
        mask = file.mask if mask is None else mask | file.mask
    return mask


def write_region(
    folder: Path, name: str, drawing: RegionDrawing, file: RegionFile | None, size: tuple[int, int]
) -> tuple[list[Path], list[Path]]:
    """Writes the region of a camera of a size (W, H) px, whose present file is given; returns the
    files that were written and removed. InputError where the region leaves nothing, or the system
    refuses.
    """
    if file is not None and file.path.is_dir():
        raise InputError(f"{file.path} is a folder: replace it by {name}.png, then draw")
    mask = drawn_region(drawing, file, size)
    if mask is not None and not mask.any():
        raise InputError(f"the region of {name} is outside of its picture: draw it within")
    path = folder / "regions" / f"{name}.png"
    written, removed = [], []
    if mask is not None:
        with writing(path):
            path.parent.mkdir(exist_ok=True)
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


@dataclass(frozen=True, eq=False)
class PlaceFiles:
    """Regions and unknown places of the files."""

    sizes: dict[str, tuple[int, int]]  # width and height in px of each camera
    regions: dict[str, RegionFile]  # region files by camera name
    # (H, W) bool, unknown places that are painted, by camera name.
    painted: dict[str, NDArray[np.bool_]]
    polygons: dict[str, list[Polygon]]  # those of recording.toml in px, by camera name

    @classmethod
    def read(cls, recording: Recording) -> PlaceFiles:
        """Reads the files of a recording. InputError where a file cannot be read, or does not fit
        its camera.
        """
        sizes = {camera.name: camera.size for camera in recording.rig}
        listed = unknown_polygons(recording.folder / RECORDING_FILE, recording.camera_names)
        return cls(
            sizes,
            read_regions(recording.folder, recording.regions()),
            recording.paintings("unknown"),
            {
                name: [[(float(x), float(y)) for x, y in polygon] for polygon in polygons]
                for name, polygons in listed.items()
                if name in sizes
            },
        )

    def region_masks(self, drawn: PlacesDrawn) -> dict[str, NDArray[np.bool_]]:
        """Where the person may be, (H, W) bool, by camera name, with what is drawn."""
        masks: dict[str, NDArray[np.bool_] | None] = {
            name: file.mask for name, file in self.regions.items()
        }
        for name, drawing in drawn.regions.items():
            masks[name] = drawn_region(drawing, self.regions.get(name), self.sizes[name])
        return {name: mask for name, mask in masks.items() if mask is not None}

    def unknown_masks(self, drawn: PlacesDrawn) -> dict[str, NDArray[np.bool_]]:
        """Where nothing is known, (H, W) bool, by camera name, with what is drawn."""
        masks = {}
        for name, polygons in (self.polygons | dict(drawn.unknown)).items():
            masks[name] = painted_mask(polygons, self.sizes[name])
        for name, mask in self.painted.items():
            masks[name] = masks[name] | mask if name in masks else mask
        return {name: mask for name, mask in masks.items() if mask.any()}

    def save(self, folder: Path, drawn: PlacesDrawn) -> tuple[list[Path], list[Path]]:
        """Writes what is drawn; returns the files that were written and removed. InputError where a
        file cannot be written.
        """
        written, removed = [], []
        for name, drawing in drawn.regions.items():
            file, size = self.regions.get(name), self.sizes[name]
            new, old = write_region(folder, name, drawing, file, size)
            written += new
            removed += old
        corners = {
            name: [[[_rounded(x), _rounded(y)] for x, y in polygon] for polygon in listed] or None
            for name, listed in drawn.unknown.items()
        }
        if change_section(folder / RECORDING_FILE, "unknown", corners):
            written.append(folder / RECORDING_FILE)
        return written, removed


@dataclass(frozen=True, eq=False)
class DrawnRecording(Recording):
    """A recording with regions and unknown places that need not be saved."""

    # Where the person may be, (H, W) bool, by camera name.
    drawn_regions: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    # Where nothing is known, (H, W) bool, by camera name.
    drawn_unknown: dict[str, NDArray[np.bool_]] = field(default_factory=dict)

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """See `FrameSource.regions`."""
        return self.drawn_regions

    def unknown(self) -> dict[str, NDArray[np.bool_]]:
        """See `FrameSource.unknown`."""
        return self.drawn_unknown


def change_section(path: Path, section: str, values: Mapping[str, Any]) -> bool:
    """Changes values of a section of a TOML file, fit or calibrate.sync, by their keys, None takes
    one out; its comments, and all else in it, stay. Returns whether there was anything to write:
    only then a file is made. InputError where it is no TOML, the section is none, or it cannot be
    written.
    """
    if not values or (not path.exists() and all(value is None for value in values.values())):
        return False
    table = document = _open_toml(path)
    *above, last = section.split(".")
    for name in (*above, last):
        table = table.setdefault(name, tomlkit.table(is_super_table=name in above))
        if not isinstance(table, dict):
            raise InputError(f"{path}: {section} is no table: mend it or remove it")
    for name, value in values.items():
        if value is None:
            table.pop(name, None)
        else:
            table[name] = value
    write_whole(path, tomlkit.dumps(document) or "\n")
    return True


def _open_toml(path: Path) -> tomlkit.TOMLDocument:
    """A TOML file with its comments and its order; an empty one where there is none."""
    if not path.exists():
        return tomlkit.document()
    text = load_text(path, _LARGEST_BYTES)
    parse_toml(text, path)
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise InputError(f"{path}: no valid TOML: {str(error)[:200]}; mend it") from None


def _rounded(pixel: float) -> int | float:
    """A coordinate to tenths of a pixel, whole ones without a point."""
    rounded = round(pixel, 1)
    return int(rounded) if rounded == int(rounded) else rounded


def setting_ranges() -> dict[str, dict[str, float | None]]:
    """Smallest and largest number that a setting may be, by its name."""
    ranges = {name: range_of(options_of(Fit)[name].kind) for name in CHOICES}
    return {name: {"min": least, "max": most} for name, (least, most) in ranges.items()}


def check_choices(chosen: Typed, names: Iterable[str]) -> None:
    """Checks settings of `fit`, of a recording that has cameras of these names. InputError where
    one is none of the page's, or makes no sense.
    """
    options = {name: option for name, option in options_of(Fit).items() if name in CHOICES}
    given = {name: value for name, value in chosen.items() if value is not None}
    values = checked_values(options, given, Path(), "the page")
    check_camera_names(camera_names(values.get("cameras")) or (), names)
    up_direction(values.get("up"))
