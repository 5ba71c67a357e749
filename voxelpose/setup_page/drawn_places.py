"""Regions and unknown places: as the files of a recording have them, as drawn, and saved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray
from tomlkit.exceptions import TOMLKitError

from calib.atomic import write_whole
from calib.documents import load_text, parse_toml
from calib.errors import InputError
from voxelpose.recording.folder import Recording, pictures_by_camera
from voxelpose.recording.unknown_places import (
    RECORDING_FILE,
    paint_unknown,
    painted_mask,
    unknown_polygons,
)
from voxelpose.setup_page.page_requests import PlacesDrawn, Polygon
from voxelpose.setup_page.region_files import RegionFile, drawn_region, read_regions, write_region

_LARGEST_BYTES = 1_000_000


@dataclass(frozen=True, eq=False)
class PlaceFiles:
    """Regions and unknown places of the files.

    Attributes:
        sizes: width and height in px of each camera.
        regions: region files by camera name.
        painted: (H, W) bool, unknown places that are painted, by camera name.
        polygons: those of recording.toml in px, by camera name.
    """

    sizes: dict[str, tuple[int, int]]
    regions: dict[str, RegionFile]
    painted: dict[str, NDArray[np.bool_]]
    polygons: dict[str, list[Polygon]]

    @classmethod
    def read(cls, recording: Recording) -> PlaceFiles:
        """Reads the files of a recording.

        Raises:
            InputError: a file cannot be read, or does not fit its camera.
        """
        sizes = {camera.name: camera.size for camera in recording.rig}
        paths = pictures_by_camera(recording.folder / "unknown", stills=True)
        listed = unknown_polygons(recording.folder / RECORDING_FILE, recording.camera_names)
        return cls(
            sizes,
            read_regions(recording.folder, recording.regions()),
            paint_unknown(paths, recording.rig, recording.camera_names),
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
        """Writes what is drawn; returns the files that were written and removed.

        Raises:
            InputError: a file cannot be written.
        """
        written, removed = [], []
        for name, drawing in drawn.regions.items():
            file, size = self.regions.get(name), self.sizes[name]
            new, old = write_region(folder, name, drawing, file, size)
            written += new
            removed += old
        corners = {
            name: [[[_short(x), _short(y)] for x, y in polygon] for polygon in listed] or None
            for name, listed in drawn.unknown.items()
        }
        if change_section(folder / RECORDING_FILE, "unknown", corners):
            written.append(folder / RECORDING_FILE)
        return written, removed


@dataclass(frozen=True, eq=False)
class DrawnRecording(Recording):
    """A recording with regions and unknown places that need not be saved.

    Attributes:
        drawn_regions: where the person may be, (H, W) bool, by camera name.
        drawn_unknown: where nothing is known, (H, W) bool, by camera name.
    """

    drawn_regions: dict[str, NDArray[np.bool_]] = field(default_factory=dict)
    drawn_unknown: dict[str, NDArray[np.bool_]] = field(default_factory=dict)

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        """See `FrameSource.regions`."""
        return self.drawn_regions

    def unknown(self) -> dict[str, NDArray[np.bool_]]:
        """See `FrameSource.unknown`."""
        return self.drawn_unknown


def change_section(path: Path, section: str, values: Mapping[str, Any]) -> bool:
    """Changes a section of a TOML file; its comments, and all else in it, stay. Returns whether
    there was anything to write.

    Args:
        path: the file; made where there is none and something to write.
        values: by key; None takes one out.

    Raises:
        InputError: the file is no TOML, the section is none, or the file cannot be written.
    """
    if not values or (not path.exists() and all(value is None for value in values.values())):
        return False
    document = _open_toml(path)
    table = document.setdefault(section, tomlkit.table())
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


def _short(pixel: float) -> int | float:
    """A coordinate to tenths of a pixel, whole ones without a point."""
    rounded = round(pixel, 1)
    return int(rounded) if rounded == int(rounded) else rounded
