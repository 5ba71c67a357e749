"""Skin weights: every joint has a zone across which its two parts blend.

The zone lies along a plane through the joint and is about as wide as the limb. The surface belongs
to a limb where it is nearer to it than to the trunk, so that an arm moves the armpit but not the
flank; left and right blend only within a finger's breadth of the crotch.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import PART_NAMES
from tools.templates import mesh
from tools.templates.figures import ARM, Figure

MIRROR = np.array(
    [
        PART_NAMES.index(n.replace("left", "*").replace("right", "left").replace("*", "right"))
        for n in PART_NAMES
    ],
    np.int32,
)
"""The part on the other side of the body."""

# Parts before their children: plane normal (None: along the arm), half width of the zone, shift of
# the plane from the joint.
Plane = tuple[tuple[float, float, float], float, tuple[float, float, float]]
_HERE = (0.0, 0.0, 0.0)
_UPWARD = (0.0, 0.0, 1.0)
_ALONG_ARM = (float(ARM[0]), 0.0, float(ARM[2]))
SPINE: tuple[tuple[str, Plane], ...] = (
    ("lumbar", (_UPWARD, 0.035, _HERE)),
    ("abdomen", (_UPWARD, 0.030, _HERE)),
    ("thorax", (_UPWARD, 0.030, _HERE)),
    ("upper_thorax", (_UPWARD, 0.030, _HERE)),
    ("neck", ((0, -0.40, 0.92), 0.020, _HERE)),
    ("head", ((0, -0.62, 0.78), 0.018, (0, 0.013, -0.022))),
)
ARM_CHAIN: tuple[tuple[str, Plane], ...] = (
    ("left_forearm", (_ALONG_ARM, 0.028, _HERE)),
    ("left_hand", (_ALONG_ARM, 0.016, _HERE)),
    ("left_fingers", (_ALONG_ARM, 0.010, _HERE)),
)
LEG_CHAIN: tuple[tuple[str, Plane], ...] = (
    ("left_shin", ((0, 0, -1), 0.034, _HERE)),
    ("left_foot", ((0, -0.35, -0.94), 0.016, _HERE)),
    ("left_toes", ((0, -1, 0), 0.014, _HERE)),
)
CLAVICLE: Plane = ((0.80, 0, 0.60), 0.036, (0.046, 0, -0.012))
SHOULDER: Plane = ((0.92, 0, -0.38), 0.040, _HERE)
HIP: Plane = ((0.62, 0, -0.78), 0.055, (0, 0, -0.008))


def dense_weights(vertices: NDArray[np.floating], figure: Figure) -> NDArray[np.float64]:
    """Weights (V, 27) of all parts at vertices (V, 3) in units of stature."""
    left = vertices * [1, 1, 1]
    left[:, 0] = np.abs(left[:, 0])
    weights = np.zeros((len(vertices), len(PART_NAMES)))
    nearness = _distance(left, mesh.trunk(figure, 1.0)) - _distance(left, mesh.arm(figure))
    arm = _ramp(nearness, 0.012) * _beyond(left, figure.joints["left_upper_arm"], SHOULDER)
    leg = _beyond(left, figure.thigh_top, HIP) * (1 - arm)
    trunk = 1 - arm - leg
    neck, neck_plane = SPINE[4]
    clavicle = (
        _beyond(left, figure.joints["left_clavicle"], CLAVICLE)
        * (1 - _beyond(left, figure.joints[neck], neck_plane))
        * trunk
    )
    _distribute(weights, trunk - clavicle, "pelvis", SPINE, left, figure)
    weights[:, PART_NAMES.index("left_clavicle")] = clavicle
    _distribute(weights, arm, "left_upper_arm", ARM_CHAIN, left, figure)
    _thumb(weights, left, figure)
    _distribute(weights, leg, "left_thigh", LEG_CHAIN, left, figure)
    # So far the left limbs have the weights of both sides: mirror those of the right half.
    side = _ramp(vertices[:, 0], 0.010)[:, None]
    return (
        weights * side + weights[:, MIRROR] * (1 - side) if np.any(vertices[:, 0] < 0) else weights
    )


def strongest(
    weights: NDArray[np.floating], count: int = 4
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Largest weights of each vertex, normalised to sum to 1.

    Args:
        weights: (V, 27).
        count: number of weights per vertex.

    Returns:
        Parts (V, count) int32 and weights (V, count) float32, largest first.
    """
    parts = np.argsort(-weights, axis=1, kind="stable")[:, :count]
    kept = np.take_along_axis(weights, parts, axis=1)
    kept = np.where(kept < 0.005, 0.0, kept)
    kept /= kept.sum(1, keepdims=True)
    return np.where(kept > 0, parts, parts[:, :1]).astype(np.int32), kept.astype(np.float32)


def face_parts(weights: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.int32]:
    """Part (F,) of the largest weight over each face's corners."""
    return weights[faces].sum(1).argmax(1).astype(np.int32)


def _ramp(value: NDArray[np.floating], half_width: float) -> NDArray[np.float64]:
    """Smooth step from 0 at -half_width to 1 at half_width."""
    t = np.clip((value / half_width + 1) / 2, 0, 1)
    return t * t * (3 - 2 * t)


def _beyond(
    points: NDArray[np.floating], origin: NDArray[np.floating], plane: Plane
) -> NDArray[np.float64]:
    normal, half_width, shift = plane
    unit = np.array(normal) / np.linalg.norm(normal)
    return _ramp((points - origin - shift) @ unit, half_width)


def _distance(points: NDArray[np.floating], group: mesh.Group) -> NDArray[np.float64]:
    return np.min([solid.values(points) for solid, _ in group], axis=0)


def _distribute(
    weights: NDArray[np.float64],
    whole: NDArray[np.floating],
    root: str,
    chain: Sequence[tuple[str, Plane]],
    points: NDArray[np.floating],
    figure: Figure,
) -> None:
    """Distributes a weight along a chain of parts, divided at the joints."""
    holder = PART_NAMES.index(root)
    weights[:, holder] = whole
    for name, plane in chain:
        passed = _beyond(points, figure.joints[name], plane) * weights[:, holder]
        weights[:, holder] -= passed
        holder = PART_NAMES.index(name)
        weights[:, holder] = passed


def _thumb(weights: NDArray[np.float64], points: NDArray[np.floating], figure: Figure) -> None:
    """Moves weight from hand and fingers to the thumb where that is nearer than the palm."""
    *_, palm, thumb = (solid for solid, _ in mesh.arm(figure))
    fraction = _ramp(palm.values(points) - thumb.values(points) - 0.002, 0.006)
    fraction *= _ramp((points - figure.joints["left_thumb"]) @ ARM - 0.006, 0.012)
    hand, fingers, own = (PART_NAMES.index(f"left_{name}") for name in ("hand", "fingers", "thumb"))
    weights[:, own] = fraction * (weights[:, hand] + weights[:, fingers])
    weights[:, hand] *= 1 - fraction
    weights[:, fingers] *= 1 - fraction
