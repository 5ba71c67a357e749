"""Whether silhouettes can be those of a person at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.tuning import PLAUSIBILITY

MOMENTS = 8
"""Number of moments of a recording that tell it."""


def check_plausible(masks: Mapping[str, Sequence[NDArray[np.bool_]]], least: int) -> None:
    """Checks that enough cameras have silhouettes that can be those of a person.

    Args:
        masks: silhouettes (H, W) bool of a few moments, by camera name.
        least: number of cameras that must have them.

    Raises:
        InputError: fewer do: the others' cover nearly the whole picture, or are noise.
    """
    found = {name: _fault(kept) for name, kept in masks.items()}
    faults = [f"those of {name} {fault}" for name, fault in found.items() if fault]
    if len(masks) - len(faults) < least and faults:
        raise InputError(
            f"the silhouettes cannot be those of a person: {'; '.join(faults)}: look at the masks,"
            " or at the background"
        )


def _fault(masks: Sequence[NDArray[np.bool_]]) -> str:
    shares = [float(mask.mean()) for mask in masks]
    share = float(np.median(shares))
    if share > PLAUSIBILITY.covered:
        return f"cover {100 * share:.0f} % of the picture"
    solid = [_solid(mask) for mask in masks if mask.any()]
    return (
        "are specks all over the picture" if solid and np.median(solid) < PLAUSIBILITY.solid else ""
    )


def _solid(mask: NDArray[np.bool_]) -> float:
    """Fraction of the foreground that an opening by three by three pixels leaves."""
    opened = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    return float(opened.sum() / mask.sum())
