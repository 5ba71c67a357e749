"""Variation of recorded motion, so that more is learned from it than was recorded.

A proposal that knows few poses recognises them instead of reading the silhouette. Arms of one
recording on the body of another, and slow deviations of all joints, make poses that nobody recorded
but that a body can take; so do bodies that lean, lie or turn over.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtr

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.joints import HUMAN, SIDES
from silhouette_core.monocular.tuning import VARIED_MOTION as VARIED
from silhouette_core.motion.kinematics import quaternions, rotation_matrices
from silhouette_core.motion.motion import Motion

_FRAMES_PER_KNOT = 12
_ANY_LIMB_KNOTS = 24  # frames, likewise, where both legs, or both arms, take any pose


def _limbs(*parts: str) -> list[BoolArray]:
    """Joint angles (D,) of the parts of the left and of the right limb."""
    return [
        np.array(
            [
                name.startswith(f"{side}_") and any(part in name for part in parts)
                for name in HUMAN.dof_names
            ]
        )
        for side in SIDES
    ]


_LEGS = _limbs("thigh", "shin", "foot", "toes")
_ARMS = _limbs("clavicle", "upper_arm", "forearm", "hand")
_UPPER_BODY = ~(_LEGS[0] | _LEGS[1])


def vary_motion(motion: Motion, others: Sequence[Motion], rng: np.random.Generator) -> Motion:
    """Motion with another upper body or other arms, arms or legs anywhere within their limits, slow
    deviations of the joints, leaning or tumbling, each by chance.

    Args:
        others: recorded motions of the same frame rate, from which arms are taken.

    Returns:
        T frames within the joint limits; the pelvis keeps its place.
    """
    angles, count = motion.angles_rad.copy(), len(motion)
    if rng.random() < VARIED.other_upper_body:
        angles[:, _UPPER_BODY] = _stretch(others, count, rng)[:, _UPPER_BODY]
    if rng.random() < VARIED.other_arms:
        together = rng.random() < VARIED.both
        for arms in [_ARMS[0] | _ARMS[1]] if together else _ARMS:
            angles[:, arms] = _stretch(others, count, rng)[:, arms]
    for limbs in (_ARMS, _LEGS):
        if rng.random() < VARIED.any_limb:
            _put_anywhere(angles, limbs, rng)
    if rng.random() < VARIED.deviating:
        angles += _deviations(count, rng)
    rotation = rotation_matrices(motion.root_quaternion)
    if rng.random() < VARIED.leaning:
        sigma = rng.uniform(0, np.radians(VARIED.lean_deg))
        lean = _curves(count, 3, sigma, rng) * [1.0, 1.0, 0.0]
        rotation = Rotation.from_rotvec(lean).as_matrix() @ rotation
    if rng.random() < VARIED.tumbling:
        rotation = _tumbling(count, rng) @ rotation
    return replace(
        motion,
        angles_rad=np.clip(angles, *HUMAN.dof_limits_rad.T),
        root_quaternion=quaternions(rotation),
    )


def _stretch(others: Sequence[Motion], count: int, rng: np.random.Generator) -> FloatArray:
    """Joint angles (count, D) from a random place of a random motion, sometimes in reverse."""
    other = others[int(rng.integers(len(others)))]
    first = int(rng.integers(max(1, len(other) - count)))
    frames = np.minimum(first + np.arange(count), len(other) - 1)
    return other.angles_rad[frames[::-1] if rng.random() < VARIED.reversed else frames]


def _put_anywhere(
    angles_rad: FloatArray, limbs: Sequence[BoolArray], rng: np.random.Generator
) -> None:
    """Replaces the angles (count, D) of a left and a right limb by slow movements from pose to
    pose, anywhere within their limits; often both limbs do much the same.
    """
    low, high = HUMAN.dof_limits_rad.T
    spread = _curves(len(angles_rad), len(low), 1.0, rng, _ANY_LIMB_KNOTS)
    if rng.random() < VARIED.both:
        spread[:, limbs[1]] = spread[:, limbs[0]] + 0.3 * spread[:, limbs[1]]
    anywhere = low + (high - low) * ndtr(spread)
    either = limbs[0] | limbs[1]
    angles_rad[:, either] = anywhere[:, either]


def _deviations(count: int, rng: np.random.Generator) -> FloatArray:
    """Smooth curves (count, D), radians; zero where an angle is fixed."""
    sigma = rng.uniform(*np.radians(VARIED.deviation_deg))
    return _curves(count, len(HUMAN.dof_fixed), sigma, rng) * ~HUMAN.dof_fixed


def _curves(
    count: int,
    columns: int,
    sigma: float,
    rng: np.random.Generator,
    frames_per_knot: int = _FRAMES_PER_KNOT,
) -> FloatArray:
    """Smooth curves (count, columns) through random knots."""
    knots = max(2, count // frames_per_knot + 2)
    values = rng.normal(0, sigma, (knots, columns))
    place = np.linspace(0, knots - 1, count)
    left = np.minimum(place.astype(int), knots - 2)
    part = (place - left)[:, None]
    part = part * part * (3 - 2 * part)
    return values[left] * (1 - part) + values[left + 1] * part


def _tumbling(count: int, rng: np.random.Generator) -> FloatArray:
    """Rotations (count, 3, 3) about a horizontal axis, from any angle on, at a steady rate."""
    azimuth, first = rng.uniform(0, 2 * np.pi, 2)
    angle = first + rng.normal(0, np.radians(VARIED.tumble_deg)) * np.arange(count)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
