"""Joints of virtual people as a pose network sees them: off by what it errs, unsure where they are
hidden, and at times not at all.

How far they are off is measured (`image.seen_joints`): a share of it stays for a whole take, since
people and clothes do, another wanders, and the rest is new in every frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.pose_network import FILE
from silhouette_core.image.seen_joints import deviations_m
from silhouette_core.monocular.proposal.silhouette_features import seen_codes

_STATURE_MM = 1750  # of the people by whom deviations are measured


class SeenErrors(NamedTuple):
    """How joints that a pose network sees err: `virtual` of its weights.

    Attributes:
        kept: share of the variance that stays for a take.
        wandering: share that changes slowly.
        new: share that is new in every frame.
        steady: of what wanders, the share that remains in the next frame.
        uneven: deviation of the logarithm of a joint's deviation in a take.
        together_mm: deviation of all joints together.
        hidden: mean logarithm of the odds of a joint to be hidden.
        hidden_spread: deviation of what stays of it for a take, and of what wanders.
        lost: deviations of something that wanders, above which nobody is seen.
        often_lost: share of the takes in which that happens.
    """

    kept: float
    wandering: float
    new: float
    steady: float
    uneven: float
    together_mm: float
    hidden: float
    hidden_spread: float
    lost: float
    often_lost: float

    @classmethod
    def measured(cls) -> SeenErrors:
        """Those of the pose network."""
        return cls._make(fitted_weights(FILE)["virtual"].tolist())

    def drawn(self, count: int, joints: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Errors (count, joints, 2) of deviation 1."""
        kept, wandering, new = np.sqrt([self.kept, self.wandering, self.new])
        errors = kept * rng.normal(0, 1, (joints, 2)) + new * rng.normal(0, 1, (count, joints, 2))
        slow = self.wander(count, 2 * joints, rng).reshape(errors.shape)
        return np.asarray(errors + wandering * slow, np.float64)

    def wander(self, count: int, columns: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Random numbers (count, columns) of deviation 1: each a share of that of the frame before,
        and something new.
        """
        new = rng.normal(0, 1, (count, columns))
        new[1:] *= np.sqrt(1 - self.steady**2)
        return np.asarray(lfilter([1.0], [1.0, -self.steady], new, axis=0), np.float64)


def virtual_seen_joints(
    places: NDArray[np.floating], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Codes (T, 45) float32, see `seen_codes`, of joints at places (T, 15, 2) in the window."""
    errors, (count, joints) = SeenErrors.measured(), places.shape[:2]
    hidden = errors.wander(count, joints, rng) + rng.normal(0, 1, joints)
    visibility = 1 / (1 + np.exp(errors.hidden + errors.hidden_spread * hidden))
    sigma_mm = 1000 * deviations_m(visibility)[..., None]
    sigma_mm = sigma_mm * np.exp(rng.normal(0, errors.uneven, (joints, 1)))
    errors_mm = sigma_mm * errors.drawn(count, joints, rng)
    errors_mm += errors.together_mm * errors.drawn(count, 1, rng)
    codes = seen_codes(places + errors_mm / _STATURE_MM, visibility)
    if rng.random() < errors.often_lost:
        codes[errors.wander(count, 1, rng)[:, 0] > errors.lost] = 0
    return codes
