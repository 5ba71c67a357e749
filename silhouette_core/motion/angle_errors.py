"""Errors of joint angles to be expected, from those of the joints at the ends of segments.

An estimate, to first order: errors of the joints are taken as independent and equal in all
directions. It is as good as the joints' errors that it is made from. How pelvis and thorax lean is
hardly told by the joints, and the estimate would be too good: of hip flexion, shoulder elevation,
trunk and pelvis none is given. Of the toes nobody states an error: theirs is taken to be the
ankle's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi, norm

from calib.checks import FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.gait_values import SIDES

if TYPE_CHECKING:
    from silhouette_core.motion.motion import Motion

# Angle: the ends of the segment on the near and on the far side, with {} for both sides.
_SEGMENTS = {
    "{}_hip_adduction": ("left_hip right_hip", "{}_hip {}_knee"),
    "{}_knee_flexion": ("{}_hip {}_knee", "{}_knee {}_ankle"),
    "{}_ankle_dorsiflexion": ("{}_knee {}_ankle", "{}_ankle {}_toes"),
    "{}_elbow_flexion": ("{}_shoulder {}_elbow", "{}_elbow {}_wrist"),
}


def expected_angle_errors(motion: Motion) -> Mapping[str, FloatArray]:
    r"""Median error to be expected of some anatomical angles, degrees.

    .. math::

        \varepsilon = \frac{\Phi^{-1}(3/4)}{m_3} \sqrt{\sum_j e_j^2\,
        \Bigl\lVert \frac{s_j n_f}{l_f} - \frac{s'_j n_n}{l_n} \Bigr\rVert^2}

    with the joints' median errors :math:`e_j`, the median :math:`m_3` of a chi distribution of
    three degrees of freedom, lengths :math:`l` of the near and the far segment, unit vectors
    :math:`n` orthogonal to them in the plane of both, and signs :math:`s`: 1 at a segment's end,
    -1 at its start, 0 elsewhere.

    Returns:
        (T,) float64 each, by the names of `anatomical_angles`; empty where the motion's quality
        states no errors of the joints. Half of the angles should be nearer, as of the joints.
    """
    stated_mm = motion.quality.get("joint_error_mm")
    if stated_mm is None or np.shape(stated_mm)[1] != len(LANDMARK_NAMES):
        return {}
    joints: dict[str, FloatArray] = dict(
        zip(LANDMARK_NAMES, np.swapaxes(motion.landmarks(), 0, 1), strict=True)
    )
    errors_m: dict[str, FloatArray] = dict(
        zip(LANDMARK_NAMES, np.asarray(stated_mm, float).T / 1000, strict=True)
    )
    _, origin = motion.parts()
    for side in SIDES:
        joints[f"{side}_toes"] = origin[:, motion.model.names.index(f"{side}_toes")]
        errors_m[f"{side}_toes"] = errors_m[f"{side}_ankle"]
    errors_deg = {}
    for name, segments in _SEGMENTS.items():
        for side in SIDES:
            near, far = (text.format(side, side).split() for text in segments)
            errors_deg[name.format(side)] = _propagated(near, far, joints, errors_m)
    return errors_deg


def _propagated(
    near: list[str],
    far: list[str],
    joints_m: Mapping[str, FloatArray],
    errors_m: Mapping[str, FloatArray],
) -> FloatArray:
    """Median error (T,), degrees, of the angle between two segments."""
    (u, near_m), (v, far_m) = (_direction(joints_m[a], joints_m[b]) for a, b in (near, far))
    cosine = np.clip((u * v).sum(axis=1), -1, 1)
    # Orthogonal vectors in the plane of both have the segments' angle between them.
    zero = np.zeros_like(cosine)
    by_near = np.column_stack([np.ones_like(cosine), zero]) / near_m[:, None]
    by_far = np.column_stack([cosine, np.sqrt(1 - cosine**2)]) / far_m[:, None]
    variance = zero
    for joint in {*near, *far}:
        change = _sign(joint, far) * by_far - _sign(joint, near) * by_near
        variance = variance + errors_m[joint] ** 2 * (change**2).sum(axis=1)
    return np.degrees(norm.ppf(3 / 4) / chi.median(3) * np.sqrt(variance))


def _direction(start_m: FloatArray, end_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    along = end_m - start_m
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-6)
    return along / length[:, None], length


def _sign(joint: str, ends: list[str]) -> int:
    return (joint == ends[1]) - (joint == ends[0])
