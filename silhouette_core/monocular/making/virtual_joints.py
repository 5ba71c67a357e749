"""Joints of virtual people as a pose network sees them: off by what it errs, unsure where they are
hidden, and at times not at all.

How far they are off is measured (`image.seen_joints`): a share of it stays for a whole take, since
people and clothes do, another wanders, and the rest is new in every frame.
"""

import numpy as np
from scipy.signal import lfilter

from calib.checks import Float32Array, FloatArray, RealArray
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.pose_network import FILE
from silhouette_core.image.seen_joints import deviations_m
from silhouette_core.monocular.proposal.silhouette_features import seen_codes

_STATURE_MM = 1750  # of the people by whom deviations are measured


def virtual_seen_joints(places: RealArray, rng: np.random.Generator) -> Float32Array:
    """Codes (T, 45) float32, see `seen_codes`, of joints at places (T, 15, 2) in the window."""
    count, joints = places.shape[:2]
    *shares, steady, uneven, together_mm, hidden, spread, lost, often_lost = seen_errors()
    steadily, slow, new = np.sqrt(shares)

    def wandering(columns: int) -> FloatArray:
        """(T, columns) of deviation 1: each a share of the last frame's, and something new."""
        drawn = rng.normal(0, 1, (count, columns))
        drawn[1:] *= np.sqrt(1 - steady**2)
        return np.asarray(lfilter([1.0], [1.0, -steady], drawn, axis=0), np.float64)

    def errors(joints: int) -> FloatArray:
        """Errors (T, joints, 2) of deviation 1."""
        shape = count, joints, 2
        constant = steadily * rng.normal(0, 1, (joints, 2)) + new * rng.normal(0, 1, shape)
        return np.asarray(constant + slow * wandering(2 * joints).reshape(shape), np.float64)

    visibility = 1 / (1 + np.exp(hidden + spread * (wandering(joints) + rng.normal(0, 1, joints))))
    sigma_mm = 1000 * deviations_m(visibility)[..., None]
    sigma_mm = sigma_mm * np.exp(rng.normal(0, uneven, (joints, 1)))
    errors_mm = sigma_mm * errors(joints) + together_mm * errors(1)
    codes = seen_codes(places + errors_mm / _STATURE_MM, visibility)
    if rng.random() < often_lost:
        codes[wandering(1)[:, 0] > lost] = 0
    return codes


def seen_errors() -> list[float]:
    """How joints that a pose network sees err, measured: shares of the variance that stay for a
    take, wander and are new; share of what wanders that remains in the next frame; deviation of the
    logarithm of a joint's deviation; that of all joints together, mm; mean and deviation of the log
    odds to be hidden; deviations above which nobody is seen, and the share of takes with that.
    """
    return fitted_weights(FILE)["virtual"].tolist()
