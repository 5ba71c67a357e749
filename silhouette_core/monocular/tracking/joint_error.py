"""Errors to be expected of poses from one camera, by how far apart their hypotheses are.

The posterior over the hypotheses of a frame is calibrated, so the mean distance of the hypotheses'
joints from the likeliest one's,

.. math::

    d_j = \\sum_k p_k \\, |x_{kj} - x_{1j}|,

is what the frame itself says of its error (the Bayes risk of the likeliest hypothesis). Linear
regression of the logarithm of the error on it, on its mean over the joints, on the share of their
union that body and silhouette do not have in common, and on whether the joint is occluded gives the
median error, and the deviation of what is left a log-normal distribution about it. The numbers are
the result of `python -m benchmarks.joint_error` over recordings drawn at random (docs/results.md).

Source: textbook (linear regression); the evidence is this project's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

NEAR_MM = 30
"""Error for which the probability of a joint is stated."""
ADDED_MM = 3
"""Added to errors before their logarithm is taken."""
_SPREAD_MM, _LEAST_APART = 10, 1 / 50

# Constants of the 15 joints, then the weights of: log of a joint's spread, log of the joints' mean
# spread, log of the share of the outlines that differs, occlusion of the joint.
WORLD_WEIGHTS = np.array(
    (
        "4.249 4.231 4.106 4.13 4.206 4.135 4.144 4.136 4.141 4.127 4.226 4.417 4.164 4.244 4.448 "
        "0.311 0.182 0.583 0.09"
    ).split(),
    float,
)
WORLD_DEVIATION = 779 / 1000
"""Of what the weights leave of the logarithm of the errors."""
# The same for errors relative to the pelvis.
POSE_WEIGHTS = np.array(
    (
        "0.643 2.366 3.47 3.577 2.333 3.448 3.54 3.407 3.708 3.325 3.558 3.79 3.418 3.642 3.909 "
        "0.375 0.136 0.382 0.096"
    ).split(),
    float,
)


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors to be expected of the joints of T frames.

    Attributes:
        joint_mm: (T, 15) float64, median error of a joint.
        near_probability: (T, 15) float64, that it is within 30 mm of the truth.
        pose_mm: (T,) float64, mean over the joints of the median error relative to the pelvis.
    """

    joint_mm: NDArray[np.float64]
    near_probability: NDArray[np.float64]
    pose_mm: NDArray[np.float64]


def hypothesis_spread(
    probability: NDArray[np.floating], joints_m: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Mean distance (15,) of the joints of n hypotheses from the likeliest one's, relative to the
    pelvis, m.

    Args:
        probability: (n,), of the hypotheses.
        joints_m: (n, 15, 3), the pelvis first.
    """
    relative = joints_m - joints_m[:, :1]
    away = np.linalg.norm(relative - relative[int(probability.argmax())], axis=2)
    return np.asarray(probability @ away, np.float64)


def error_evidence(
    spread_m: NDArray[np.floating],
    outline_agreement: NDArray[np.floating],
    occluded: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Numbers (T, 15, 19) that the weights belong to; arguments as of `joint_errors`."""
    frames, joints = spread_m.shape
    spread = np.log(1000 * spread_m + _SPREAD_MM)
    whole = np.log(1000 * spread_m.mean(axis=1, keepdims=True) + _SPREAD_MM)
    apart = np.log(np.clip(1 - outline_agreement, _LEAST_APART, 1.0))[:, None]
    evidence = np.stack(np.broadcast_arrays(spread, whole, apart, occluded), axis=2)
    constants = np.broadcast_to(np.eye(joints), (frames, joints, joints))
    return np.concatenate([constants, evidence], axis=2)


def joint_errors(
    spread_m: NDArray[np.floating],
    outline_agreement: NDArray[np.floating],
    occluded: NDArray[np.bool_],
) -> JointErrors:
    """Errors to be expected of T frames.

    Args:
        spread_m: (T, 15), see `hypothesis_spread`.
        outline_agreement: (T,), share of their union that body and silhouette have in common.
        occluded: (T, 15), whether the joint's part is.
    """
    inputs = error_evidence(spread_m, outline_agreement, occluded)
    world, pose = inputs @ WORLD_WEIGHTS, inputs @ POSE_WEIGHTS
    near = ndtr((np.log(NEAR_MM + ADDED_MM) - world) / WORLD_DEVIATION)
    return JointErrors(
        np.maximum(np.exp(world) - ADDED_MM, 0.0),
        near,
        np.maximum(np.exp(pose) - ADDED_MM, 0.0).mean(axis=1),
    )
