"""Contact sheets: silhouettes over the frames in which they were found, beside each other."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

_TILE_PX, _COLUMNS = 400, 5  # longer side
_FOUND, _CHECKED, _UNKNOWN = (0, 220, 255), (255, 0, 255), (160, 160, 160)  # BGR
_TINT = np.array([0, 110, 255])


@dataclass(frozen=True, eq=False)
class Tile:
    """One frame of a sheet.

    Attributes:
        picture: (h, w, 3) uint8, BGR.
        found: (h, w) bool, the silhouette: tinted, with a yellow outline.
        checked: (h, w) bool, checked by hand: with an outline in magenta; None: not checked.
        unknown: (h, w) bool, what does not count: with a grey outline; None: nothing.
        words: at the top.
    """

    picture: NDArray[np.uint8]
    found: NDArray[np.bool_]
    checked: NDArray[np.bool_] | None
    unknown: NDArray[np.bool_] | None
    words: str


def write_sheet(rows: Sequence[Sequence[Tile]], path: Path) -> None:
    """Writes rows of tiles as a PNG; long rows are broken."""
    starts = [(row, first) for row in rows for first in range(0, len(row), _COLUMNS)]
    parts = [row[first : first + _COLUMNS] for row, first in starts]
    drawn = [np.hstack([_drawn(tile) for tile in part]) for part in parts]
    width = max(row.shape[1] for row in drawn)
    padded = [np.pad(row, ((0, 4), (0, width - row.shape[1]), (0, 0))) for row in drawn]
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.vstack(padded))


def _drawn(tile: Tile) -> NDArray[np.uint8]:
    scale = _TILE_PX / max(tile.found.shape)
    size = round(tile.found.shape[1] * scale), round(tile.found.shape[0] * scale)
    picture = np.asarray(cv2.resize(tile.picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    found = _shrunk(tile.found, size)
    picture[found] = (0.6 * picture[found] + 0.4 * _TINT).astype(np.uint8)
    _outline(picture, found, _FOUND)
    for mask, colour in ((tile.unknown, _UNKNOWN), (tile.checked, _CHECKED)):
        if mask is not None:
            _outline(picture, _shrunk(mask, size), colour)
    cv2.putText(picture, tile.words, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 255))
    return picture


def _shrunk(mask: NDArray[np.bool_], size: tuple[int, int]) -> NDArray[np.bool_]:
    return cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0


def _outline(picture: NDArray[np.uint8], mask: NDArray[np.bool_], colour: Sequence[int]) -> None:
    edges, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, edges, -1, colour, 1)
