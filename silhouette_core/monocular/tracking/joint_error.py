"""Errors to be expected of poses from one camera, by how far apart their hypotheses are.

The posterior over the hypotheses of a frame is calibrated, so the mean distance of the hypotheses'
joints from the likeliest one's,

.. math::

    d_j = \\sum_k p_k \\, |x_{kj} - x_{1j}|,

is what the frame itself says of its error (the Bayes risk of the likeliest hypothesis). Linear
regression of the logarithm of the error on it, on its mean over the joints, on the share of their
union that body and silhouette do not have in common, and on whether the joint is occluded gives the
median error, and the deviation of what is left a log-normal distribution about it. The
weights stand in joint_error.toml, which `python -m benchmarks.joint_error ... --fit` writes.

Source: textbook (linear regression); the evidence is this project's.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtr

from calib.checks import BoolArray, FloatArray, RealArray
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.ranking import rounded

NEAR_MM = 30  #: Error for which the probability of a joint is stated.
ADDED_MM = 3  #: Added to errors before their logarithm is taken.
_SPREAD_MM, _LEAST_APART = 10, 1 / 50

FILE = Path(__file__).with_suffix(".toml")
"""Weights of `error_evidence`, written by the benchmark: of errors in the world, and of those
relative to the pelvis; what the former leave of the logarithm."""


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors to be expected of the joints of T frames."""

    joint_mm: FloatArray  #: (T, 15) float64, median error of a joint.
    near_probability: FloatArray  #: (T, 15) float64, that it is within 30 mm of the truth.
    pose_mm: FloatArray  #: (T,) float64, mean of the joints' median errors relative to the pelvis.


def hypothesis_spread(probability: RealArray, joints_m: RealArray) -> FloatArray:
    """Mean distance (15,) of the joints of n hypotheses from the likeliest one's, relative to the
    pelvis, m.

    Args:
        probability: (n,), of the hypotheses.
        joints_m: (n, 15, 3), the pelvis first.
    """
    relative = joints_m - joints_m[:, :1]
    distances = np.linalg.norm(relative - relative[int(rounded(probability).argmax())], axis=2)
    return np.asarray(probability @ distances, np.float64)


def error_evidence(
    spread_m: RealArray, outline_agreement: RealArray, occluded: BoolArray
) -> FloatArray:
    """Numbers (T, 15, 19) that the weights belong to; arguments as of `joint_errors`."""
    frames, joints = spread_m.shape
    spread = np.log(1000 * spread_m + _SPREAD_MM)
    whole = np.log(1000 * spread_m.mean(axis=1, keepdims=True) + _SPREAD_MM)
    apart = np.log(np.clip(1 - outline_agreement, _LEAST_APART, 1.0))[:, None]
    evidence = np.stack(np.broadcast_arrays(spread, whole, apart, occluded), axis=2)
    constants = np.broadcast_to(np.eye(joints), (frames, joints, joints))
    return np.concatenate([constants, evidence], axis=2)


def joint_errors(
    spread_m: RealArray, outline_agreement: RealArray, occluded: BoolArray
) -> JointErrors:
    """Errors to be expected of T frames.

    Args:
        spread_m: (T, 15), see `hypothesis_spread`.
        outline_agreement: (T,), share of their union that body and silhouette have in common.
        occluded: (T, 15), whether the joint's part is.
    """
    inputs = error_evidence(spread_m, outline_agreement, occluded)
    weights = fitted_weights(FILE)
    world, pose = inputs @ weights["world"], inputs @ weights["pose"]
    near = ndtr((np.log(NEAR_MM + ADDED_MM) - world) / weights["world_deviation"])
    return JointErrors(
        np.maximum(np.exp(world) - ADDED_MM, 0.0),
        near,
        np.maximum(np.exp(pose) - ADDED_MM, 0.0).mean(axis=1),
    )
