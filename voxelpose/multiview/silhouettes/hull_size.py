"""Whether hulls are of a person's size: those of a calibration in a wrong unit are not."""

from collections.abc import Sequence

import numpy as np

from calib.camera import Rig
from calib.components import label_components
from calib.errors import InputError
from silhouette_core.body.sizes import STATURES_M
from silhouette_core.tuning import MEASURING
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.tuning import CARVING

_MISTAKES = {
    1: ("millimetres, and not in centimetres", "mm"),
    2: ("centimetres, and not in metres", "cm"),
    3: ("millimetres, and not in metres", "mm"),
    -1: ("centimetres, and not in millimetres", "cm"),
    -2: ("metres, and not in centimetres", "m"),
    -3: ("metres, and not in millimetres", "m"),
}
"""What the calibration's lengths are by the power of ten of the hull's size, and their unit."""


def check_hull_size(
    rig: Rig,
    moments: Sequence[Sequence[np.ndarray]],
    rule: CarveRule,
    stature_m: float | None,
    unknown: Sequence[np.ndarray] | None = None,
) -> None:
    """Checks that the hulls of a person are of a person's size. Raises InputError where they are
    far larger or smaller.

    Args:
        rig: C cameras.
        moments: C silhouettes (h, w) bool of each of some moments.
        rule: of carving.
        stature_m: of the person, where it is known.
        unknown: as of `carve`.
    """
    edges_m = [_edges_m(rig, masks, rule, unknown) for masks in moments]
    edges_m = [edge for edge in edges_m if edge is not None]
    if not edges_m:
        return
    width_m, length_m = np.median(edges_m, axis=0)[1:].tolist()
    # Two cameras that look at each other bound a hull in all directions but one.
    large = np.sqrt(width_m * length_m) > CARVING.unlikely * (stature_m or MEASURING.usual_m)
    if not large and length_m > (stature_m or STATURES_M[0]) / CARVING.unlikely:
        return
    times = length_m / (stature_m or MEASURING.usual_m)
    power = min(_MISTAKES, key=lambda power: abs(power - np.log10(times)))
    lengths, unit = _MISTAKES[power]
    raise InputError(
        f"the person is about {length_m:.3g} m tall by the hull: are the calibration's lengths in"
        f" {lengths}? Correct the unit that it states, or give --unit {unit} where it states none"
    )


def _edges_m(
    rig: Rig, masks: Sequence[np.ndarray], rule: CarveRule, unknown: Sequence[np.ndarray] | None
) -> np.ndarray | None:
    """Ascending edges (3,) of the largest piece of a moment's hull, m; None where there is none."""
    try:
        grid = place_grid(rig, list(masks), rule=rule, unknown=unknown)
    except InputError:
        return None
    voxels = label_components(carve(rig, list(masks), grid, rule, unknown))
    if len(voxels.sizes) < 2:
        return None
    return np.sort(np.ptp(voxels.bounds[voxels.sizes[1:].argmax()], axis=0)) * grid.voxel_size_m
