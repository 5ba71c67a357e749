"""Girth of a body, from the volume of its visual hull."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import CHESTS_M
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.tuning import HULL_GIRTH

GIRTH_CAMERAS = 4
"""Fewest cameras whose hull says anything of the girth: that of fewer varies too much."""


def hull_volume_m3(frame: FrameObservation) -> float:
    """Volume of a frame's visual hull."""
    return float(np.count_nonzero(frame.occupancy) * frame.grid.voxel_size_m**3)


def chest_from_hull(model: BodyModel, hull_m3: float) -> float:
    """Chest girth, m, at which a body fills its visual hull as usual, as far as people's go.

    Args:
        model: of usual girth.
        hull_m3: volume of the hull.
    """
    usual_m3 = HULL_GIRTH.hull_over_body * model.part_volumes_m3(0.02).sum()
    girth = float(np.clip(np.sqrt(hull_m3 / usual_m3), HULL_GIRTH.least, HULL_GIRTH.most))
    return float(np.clip(girth * HULL_GIRTH.usual_chest * model.sizes.stature_m, *CHESTS_M))
