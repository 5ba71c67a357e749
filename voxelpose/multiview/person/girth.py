"""Girth of a body, from the volume of its visual hull."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import CHESTS_M, SHAPE_AXES
from voxelpose.multiview.carving.observe import FrameObservation

GIRTH_CAMERAS = 4
"""Fewest cameras whose hull says anything of the girth: that of fewer varies too much."""
# Of people of usual girth the hull of four to eight cameras has this many times the volume.
_HULL_OVER_BODY, _COUNTED_M = 1.75, 0.02
_GIRTH_AXES = ("trunk_width", "trunk_depth", "upper_arm_girth", "thigh_girth", "shin_girth")
_USUAL_CHEST = 0.55  # chest girth over stature
_GIRTHS = [k for k, axis in enumerate(SHAPE_AXES) if axis.name in _GIRTH_AXES]
_RANGE = 0.9, 1.5  # of girths, relative to the usual one


def hull_volume_m3(frame: FrameObservation) -> float:
    """Volume of a frame's visual hull."""
    return float(np.count_nonzero(frame.occupancy) * frame.grid.voxel_size_m**3)


def chest_from_hull(model: BodyModel, hull_m3: float) -> float:
    """Chest girth, m, at which a body fills its visual hull as usual, as far as people's go.

    Args:
        model: of usual girth.
        hull_m3: volume of the hull.
    """
    usual_m3 = _HULL_OVER_BODY * model.part_volumes_m3(_COUNTED_M).sum()
    girth = float(np.clip(np.sqrt(hull_m3 / usual_m3), *_RANGE))
    return float(np.clip(girth * _USUAL_CHEST * model.sizes.stature_m, *CHESTS_M))
