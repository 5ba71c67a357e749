"""Colours and texts of the viewer."""

import numpy as np
from numpy.typing import NDArray

from voxelpose.people_marks import COLOURS
from voxelpose.view.images.canvas import Colour

# RGB, vermilion over yellow to blue: no kind of colour vision confuses the ends.
_RAMP = np.array([[213, 62, 20], [244, 190, 60], [64, 132, 214]])
UNKNOWN: Colour = (150, 150, 150)
HULL: Colour = (140, 150, 160)
SILHOUETTE: Colour = (255, 150, 40)
OUTLYING_CM = 5
"""Distance from the body above which a voxel is unexplained: a hull of few cameras is too large."""
FAR = f"more than {OUTLYING_CM} cm from the body"


def overlap_colours(overlap: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours (n, 3) uint8 RGB of fractions (n,) of parts inside the hull; grey where NaN."""
    position = np.clip(np.nan_to_num(overlap), 0, 1) * (len(_RAMP) - 1)
    low = np.minimum(position.astype(int), len(_RAMP) - 2)
    mixed = _RAMP[low] + (position - low)[:, None] * (_RAMP[low + 1] - _RAMP[low])
    return np.where(np.isfinite(overlap)[:, None], mixed, UNKNOWN).round().astype(np.uint8)


def display_name(part: str) -> str:
    """Name of a part with spaces."""
    return part.replace("_", " ")


def person_colour(number: int) -> Colour:
    """Colour, RGB, of one of several people, counted from 0."""
    return COLOURS[number % len(COLOURS)]
