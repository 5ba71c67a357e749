"""Trunk and thighs of the template bodies made wider or narrower, height by height.

The trunk axes of the shape space widen the whole trunk together. A person's chest, waist and hips
do not follow each other, so the template itself is warped before the shape space is built around
it. The warp changes horizontal slices and maps space one to one: thighs, however thick, do not run
into each other.
"""

import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray
from silhouette_core.body.joints import ARM_PARTS, PART_NAMES

Changes = tuple[float, float, float, float]
"""Relative growth of chest, waist, hips and thighs; above -1, of the thighs below 1."""

# Heights in thousandths of the stature: below the first and above the last nothing grows, between
# the two in the middle the whole change counts.
_THIGH = (245, 370, 425, 490)
_HIP = (425, 490, 525, 625)
_WAIST = (525, 625, 650, 725)
_CHEST = (650, 720, 745, 830)
_FLANKS = (650, 715, 720, 775)  # less far up: arms and flanks would run into each other
# Bands of the growth in breadth and in depth, and how much of the change each is, per cent. Chests
# vary more in depth: ANSUR II, chest depth has a standard deviation of 10 % of its mean, breadth
# one of 6 %.
_BREADTHS = ((_FLANKS, 65), (_WAIST, 90), (_HIP, 100))
_DEPTHS = ((_CHEST, 135), (_WAIST, 110), (_HIP, 100))
# Line of the trunk from which flesh grows to the front and to the back: height and y, likewise.
_LINE = np.array([(460, 0), (520, 10), (600, 14), (745, 20)]).T / 1000


def warp_template(
    vertices_m: FloatArray,
    joints_m: FloatArray,
    skin_parts: NDArray[np.int32],
    skin_weights: FloatArray,
    changes: Changes,
) -> FloatArray:
    """Vertices (V, 3) of a template with other chest, waist, hips and thighs, linear in these.

    Args:
        vertices_m: (V, 3), soles at z = 0.
        joints_m: (27, 3), which stay.
        skin_parts: (V, 4) parts that move a vertex.
        skin_weights: (V, 4) their weights; what belongs to an arm stays where it is.
        changes: relative growth at chest, waist, hips and thighs.
    """
    stature = float(np.ptp(vertices_m[:, 2]))
    x, y, z = vertices_m.T / stature
    breadth, depth = (
        sum(
            change * (part / 100) * _plateau(z, band)
            for change, (band, part) in zip(changes[:3], bands, strict=True)
        )
        * offset
        for bands, offset in ((_BREADTHS, x), (_DEPTHS, y - np.interp(z, *_LINE)))
    )
    bone = np.stack([joints_m[PART_NAMES.index(f"left_{name}")] for name in ("shin", "thigh")])
    bone_x, bone_y = (np.interp(z, *(bone.T / stature)[[2, k]]) for k in (0, 1))
    # Toward the other thigh the growth vanishes at the sagittal plane, so that they never touch.
    growth = changes[3] * _plateau(z, _THIGH)
    breadth = breadth + growth * np.sign(x) * (np.abs(x) - bone_x) * np.minimum(
        np.abs(x) / bone_x, 1
    )
    depth = depth + growth * (y - bone_y)
    share = 1 - np.where(np.isin(skin_parts, ARM_PARTS), skin_weights, 0.0).sum(1)
    return vertices_m + stature * np.column_stack(
        [share * breadth, share * depth, np.zeros_like(z)]
    )


def _plateau(z: FloatArray, band: tuple[int, int, int, int]) -> FloatArray:
    """One between the two middle heights, zero beyond the outer ones, smooth between."""
    low, bottom, top, high = (height / 1000 for height in band)
    t = np.clip(np.minimum((z - low) / (bottom - low), (high - z) / (high - top)), 0, 1)
    return t * t * (3 - 2 * t)
