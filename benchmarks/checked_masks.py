"""Outlines of people in real footage that were checked by hand: datasets/footage, see its card."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

FOOTAGE = Path(__file__).resolve().parents[1] / "datasets" / "footage"
_NO_PERSON = ("holes", "unknown")

Polygons = Iterable[Iterable[Iterable[int]]]


@dataclass(frozen=True)
class CheckedFrame:
    """Polygons of one frame, in pixels of the video.

    Attributes:
        people: outlines of each person, by name.
        holes: what lies within an outline and is no person.
        unknown: what may be a person or not, and does not count.
    """

    people: Mapping[str, Polygons]
    holes: Polygons
    unknown: Polygons

    def masks_of_people(
        self, video_px: tuple[int, int], size_px: tuple[int, int]
    ) -> list[NDArray[np.bool_]]:
        """Mask (h, w) bool of each person.

        Args:
            video_px: (width, height) of the video.
            size_px: (width, height) of the masks.
        """
        hole = painted(self.holes, video_px)
        whole = [painted(polygons, video_px) & ~hole for polygons in self.people.values()]
        return [scaled_mask(mask, size_px) for mask in whole]

    def unknown_mask(
        self, video_px: tuple[int, int], size_px: tuple[int, int]
    ) -> NDArray[np.bool_]:
        """Mask (h, w) bool of what does not count; arguments as of `masks_of_people`."""
        return scaled_mask(painted(self.unknown, video_px), size_px)


def read_checked(path: Path) -> dict[str, dict[int, CheckedFrame]]:
    """Checked frames of a recording by camera name and frame number; none without a file."""
    if not path.is_file():
        return {}
    cameras = json.loads(path.read_text(encoding="utf-8"))["cameras"]
    return {
        name: {int(number): _frame(entry) for number, entry in frames.items()}
        for name, frames in cameras.items()
    }


def _frame(entry: Mapping[str, Polygons]) -> CheckedFrame:
    people = {name: drawn for name, drawn in entry.items() if name not in _NO_PERSON}
    return CheckedFrame(people, entry.get("holes", []), entry.get("unknown", []))


def painted(polygons: Polygons, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Polygons filled, their corners included: (h, w) bool."""
    mask = np.zeros(size_px[::-1], np.uint8)
    for polygon in polygons:
        cv2.fillPoly(mask, [np.array(polygon, np.int32)], 1)
    return mask > 0


def scaled_mask(mask: NDArray[np.bool_], size_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Mask in another size (width, height); pixels that are covered by half count."""
    if mask.shape[::-1] == size_px:
        return mask
    return cv2.resize(mask.view(np.uint8) * 255, size_px, interpolation=cv2.INTER_AREA) > 127
