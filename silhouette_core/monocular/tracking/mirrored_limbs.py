r"""Poses that differ from others in depth alone: limbs, trunk or the whole body mirrored.

Beyond paper A. A bone that points toward the camera leaves nearly the same silhouette as one that
points away. With the camera's centre :math:`c`, a bone from joint :math:`a` to joint :math:`b` and
the viewing ray :math:`r` of :math:`b`, the other place of :math:`b` on its ray at the same distance
from :math:`a` is

.. math:: b' = c + (2 (a - c)^T r - \lVert b - c \rVert) \, r

What hangs on :math:`b` moves along its own viewing rays in proportion. The body as a whole is
mirrored about its pelvis with left and right exchanged, which turns front to back.

Source: Sminchisescu and Triggs, Kinematic jump processes for monocular 3D human tracking (2003).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import EXCHANGED_LANDMARKS, LANDMARK_NAMES
from silhouette_core.monocular.tracking.observed_frame import ObservedFrame
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.joint_placement import held_joints, place_bodies
from silhouette_core.refinement.surface import Surface

# Of each bone the joint that stays, its other end, and what hangs on that.
_BONES = [
    [LANDMARK_NAMES.index(f"{side}_{joint}") for joint in joints]
    for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
    for joints in (limb, limb[1:])
    for side in ("left", "right")
]
_TRUNK = [0, *(LANDMARK_NAMES.index(name) for name in ("neck", "head_top"))] + [
    LANDMARK_NAMES.index(f"{side}_{joint}")
    for joint in ("shoulder", "elbow", "wrist")
    for side in ("left", "right")
]
_LEAST_TILT = 0.25  # of a bone's length, in depth: less is nearly in the picture's plane
_PLACED_M = 0.03  # deviation of the joints while the body is put there
_REACHED_M = 0.07  # a joint that stays farther away is beyond the limits of the body's joints


def mirrored_joints(
    joints_m: NDArray[np.float64], center_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joints (N, 15, 3) of the mirror images in depth of a pose, in the world.

    Args:
        joints_m: (15, 3), the pose's, in the world.
        center_m: (3,), the camera's centre.

    Returns:
        One for every bone that is not nearly in the picture's plane; last, the whole body's.
    """
    found = []
    for about, end, *beyond in [*_BONES, _TRUNK]:
        moved = joints_m[[end, *beyond]] - center_m
        away = np.linalg.norm(moved[0])
        other = np.linalg.norm(_elsewhere(joints_m[about], joints_m[end], center_m) - center_m)
        length = np.linalg.norm(joints_m[end] - joints_m[about])
        if abs(other - away) >= 2 * _LEAST_TILT * length:
            own = joints_m.copy()
            own[[end, *beyond]] = center_m + moved * (other / away)
            found.append(own)
    turned = _elsewhere(joints_m[0], joints_m, center_m)
    turned[0] = joints_m[0]
    return np.stack([*found, turned[EXCHANGED_LANDMARKS]])


def mirrored_poses(
    surface: Surface, observed: ObservedFrame, joints_m: Sequence[NDArray[np.float64]]
) -> list[Pose]:
    """Poses with given joints, but for those that the limits of the body's joints forbid.

    Args:
        surface: the body's.
        observed: the frame; its contour is not used.
        joints_m: N times (15, 3), in the world, from `mirrored_joints`.
    """
    if not len(joints_m):
        return []
    wanted = [held_joints(own, _PLACED_M) for own in joints_m]
    placed = place_bodies(surface, observed.contour, wanted)
    found = landmarks(surface.model, *place(surface.model, *PoseArrays.from_poses(placed).arrays))
    off = np.linalg.norm(found - np.stack(joints_m), axis=-1).max(axis=1)
    return [pose for pose, own in zip(placed, off, strict=True) if own < _REACHED_M]


def _elsewhere(
    about_m: NDArray[np.float64], end_m: NDArray[np.float64], center_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Other places (..., 3) of points (..., 3) on their viewing rays, as far from a point (3,)."""
    ray = end_m - center_m
    away = np.linalg.norm(ray, axis=-1, keepdims=True)
    ray = ray / away
    return center_m + (2 * (ray @ (about_m - center_m))[..., None] - away) * ray
