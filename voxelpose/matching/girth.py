"""Girth of a body, from the volume of its visual hull."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from voxelpose.matching.observe import FrameObservation

GIRTH_CAMERAS = 4
"""Fewest cameras whose hull says anything of the girth: that of fewer varies too much."""
# Of people of usual girth the hull of four to eight cameras has this many times the volume.
_HULL_OVER_BODY, _COUNTED_M = 1.75, 0.02
_USUAL_CHEST = 0.55  # chest girth over stature
_RANGE = 0.9, 1.5  # of girths, relative to the usual one


def hull_volume_m3(frame: FrameObservation) -> float:
    """Volume of a frame's visual hull."""
    return float(np.count_nonzero(frame.occupancy) * frame.grid.voxel_size_m**3)


def chest_from_hull(model: BodyModel, hull_m3: float) -> float:
    """Chest girth, m, at which a body fills its visual hull as usual.

    Args:
        model: of usual girth.
        hull_m3: volume of the hull.
    """
    usual_m3 = _HULL_OVER_BODY * model.part_volumes_m3(_COUNTED_M).sum()
    girth = float(np.clip(np.sqrt(hull_m3 / usual_m3), *_RANGE))
    return girth * _USUAL_CHEST * model.sizes.stature_m
