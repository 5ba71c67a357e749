"""Variation of recorded motion, so that more is learned from it than was recorded.

A proposal that knows few poses recognises them instead of reading the silhouette. Arms of one
recording on the body of another, and slow deviations of all joints, make poses that nobody recorded
but that a body can take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.motion import Motion

_OTHER_ARMS, _BOTH_ARMS, _REVERSED = 0.6, 0.5, 0.3  # probabilities
_DEVIATING = 0.7
_DEVIATION_RAD = (np.radians(2.0), np.radians(12.0))
_FRAMES_PER_KNOT = 12
_ARM_PARTS = ("clavicle", "upper_arm", "forearm", "hand")
_ARMS = tuple(
    np.array(
        [
            name.startswith(f"{side}_") and any(part in name for part in _ARM_PARTS)
            for name in BodyModel.dof_names
        ]
    )
    for side in ("left", "right")
)


def vary_motion(motion: Motion, others: Sequence[Motion], rng: np.random.Generator) -> Motion:
    """Motion with other arms, or with slow deviations of the joints, or both, or as it is.

    Args:
        motion: T frames.
        others: recorded motions of the same frame rate, from which arms are taken.
        rng: random numbers.

    Returns:
        T frames within the joint limits.
    """
    angles = motion.angles_rad.copy()
    if rng.random() < _OTHER_ARMS:
        together = rng.random() < _BOTH_ARMS
        for arms in [_ARMS[0] | _ARMS[1]] if together else _ARMS:
            angles[:, arms] = _stretch(others, len(motion), rng)[:, arms]
    if rng.random() < _DEVIATING:
        angles += _deviations(len(motion), rng)
    return replace(motion, angles_rad=np.clip(angles, *BodyModel.dof_limits_rad.T))


def _stretch(others: Sequence[Motion], count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Joint angles (count, D) from a random place of a random motion, sometimes in reverse."""
    other = others[int(rng.integers(len(others)))]
    first = int(rng.integers(max(1, len(other) - count)))
    frames = np.minimum(first + np.arange(count), len(other) - 1)
    return other.angles_rad[frames[::-1] if rng.random() < _REVERSED else frames]


def _deviations(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Smooth curves (count, D), radians, through random knots; zero where an angle is fixed."""
    knots = max(2, count // _FRAMES_PER_KNOT + 2)
    values = rng.normal(0, rng.uniform(*_DEVIATION_RAD), (knots, len(BodyModel.dof_fixed)))
    place = np.linspace(0, knots - 1, count)
    left = np.minimum(place.astype(int), knots - 2)
    part = (place - left)[:, None]
    part = part * part * (3 - 2 * part)
    return (values[left] * (1 - part) + values[left + 1] * part) * ~BodyModel.dof_fixed
