"""Joints of virtual people as a pose network sees them: off by what it errs, unsure where they are
hidden, and at times not at all.

How far they are off is measured (`image.seen_joints`): a share of it stays for a whole take, since
people and clothes do, another wanders, and the rest is new in every frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from silhouette_core.image.seen_joints import deviations_m
from silhouette_core.monocular.proposal.silhouette_features import seen_codes
from silhouette_core.monocular.tuning import VIRTUAL_JOINTS as JOINTS

_STATURE_MM = 1750  # of the people by whom deviations are measured
_OFTEN_LOST = 0.25  # share of the takes in which nobody is seen at times


def virtual_seen_joints(
    places: NDArray[np.floating], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Codes (T, 45) float32, see `seen_codes`, of joints at places (T, 15, 2) in the window."""
    count, joints = places.shape[:2]
    mean, spread = JOINTS.hidden
    odds = mean + spread * (_wandering(count, joints, rng) + rng.normal(0, 1, joints))
    visibility = 1 / (1 + np.exp(odds))
    sigma_mm = 1000 * deviations_m(visibility)[..., None]
    sigma_mm = sigma_mm * np.exp(rng.normal(0, JOINTS.uneven, (joints, 1)))
    errors_mm = sigma_mm * _errors(count, joints, rng)
    errors_mm += JOINTS.together_mm * _errors(count, 1, rng)
    codes = seen_codes(places + errors_mm / _STATURE_MM, visibility)
    if rng.random() < _OFTEN_LOST:
        codes[_wandering(count, 1, rng)[:, 0] > JOINTS.lost] = 0
    return codes


def _errors(count: int, joints: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Errors (count, joints, 2) of deviation 1."""
    kept, wandering, new = np.sqrt(JOINTS.shares)
    errors = kept * rng.normal(0, 1, (joints, 2)) + new * rng.normal(0, 1, (count, joints, 2))
    return errors + wandering * _wandering(count, 2 * joints, rng).reshape(errors.shape)


def _wandering(count: int, columns: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Random numbers (count, columns) of deviation 1: each a share of that of the frame before, and
    something new.
    """
    new = rng.normal(0, 1, (count, columns))
    new[1:] *= np.sqrt(1 - JOINTS.steady**2)
    return np.asarray(lfilter([1.0], [1.0, -JOINTS.steady], new, axis=0), np.float64)
