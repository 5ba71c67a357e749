"""Constants of posture and movement, and prediction of poses from frame to frame."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.pose import Pose

#: Frame rate, 1/s, to which all step sizes refer, and at which recorded motion is used.
FPS = 30.0
#: Fraction of the last step that the next one is expected to repeat.
MOMENTUM = 0.8
_SHORTEST_STEP = 0.5

# Standard deviation of joint angles about the resting stance, degrees.
_USUAL_DEG = {
    "lumbar": 15,
    "thorax": 12,
    "neck": 20,
    "clavicle": 10,
    "upper_arm": 60,
    "upper_arm.twist": 35,
    "forearm": 60,
    "hand": 15,
    "thigh": 50,
    "thigh.abduction": 25,
    "thigh.rotation": 20,
    "shin": 60,
    "foot": 15,
}
# Standard deviation of a joint's turn within 1 / FPS beyond what was predicted, degrees.
_STEP_SIGMA_DEG = {
    "lumbar": 3,
    "thorax": 3,
    "neck": 6,
    "clavicle": 4,
    "upper_arm": 14,
    "forearm": 16,
    "hand": 12,
    "thigh": 9,
    "shin": 12,
    "foot": 12,
}
_RELAXED_DEG = {
    "upper_arm.abduction": -30.0,
    "forearm.flexion": 20.0,
    "shin.flexion": 8.0,
    "thigh.flexion": 4.0,
}


# Of bodies that are no person's, about which nothing is known: degrees.
_ANY_USUAL_DEG, _ANY_STEP_DEG = 120.0, 12.0
_ROOT_FIXED_SIGMA = 1e-5  # m and rad


def _per_dof_rad(
    table_deg: Mapping[str, float], default_deg: float, tree: KinematicTree = HUMAN
) -> np.ndarray:
    """(D,) radians from a table by part or by part and movement, the same for both sides."""
    values = []
    for name in tree.dof_names:
        base = name.removeprefix("left_").removeprefix("right_")
        values.append(table_deg.get(base, table_deg.get(base.partition(".")[0], default_deg)))
    return np.radians(values)


#: (D,) standard deviation of the joint angles about `RELAXED_RAD`.
USUAL_RAD = _per_dof_rad(_USUAL_DEG, 10.0)
#: (D,) joint angles of the resting stance.
RELAXED_RAD = _per_dof_rad(_RELAXED_DEG, 0.0)
#: (D,) standard deviation of the joint angles' steps within 1 / `FPS`.
STEP_SIGMA_RAD = _per_dof_rad(_STEP_SIGMA_DEG, 3.0)
#: Standard deviation of the root's step along each axis within 1 / `FPS`, m.
ROOT_STEP_M = 0.05
#: Standard deviation of the root's turn about each axis within 1 / `FPS`, radians.
ROOT_STEP_RAD = 0.12
#: (6 + D,) standard deviations of all coordinates of a step, in the order of `Pose.minus`.
POSE_STEP_SIGMA = np.concatenate([[ROOT_STEP_M] * 3, [ROOT_STEP_RAD] * 3, STEP_SIGMA_RAD])


def is_person_tree(tree: KinematicTree) -> bool:
    """Whether a tree is a person's, perhaps with parts added."""
    return {*HUMAN.names, *HUMAN.dof_names} <= {*tree.names, *tree.dof_names}


@lru_cache(maxsize=16)
def usual_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) standard deviation of a body's joint angles about `relaxed_rad`: wide where the body is
    no person's.
    """
    if is_person_tree(tree):
        return _per_dof_rad(_USUAL_DEG, 10.0, tree)
    return np.full(len(tree.dofs), np.radians(_ANY_USUAL_DEG))


@lru_cache(maxsize=16)
def relaxed_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) joint angles of a body's resting stance: of other bodies than a person's at rest, or as
    near as the limits allow.
    """
    table = _RELAXED_DEG if is_person_tree(tree) else {}
    return np.clip(_per_dof_rad(table, 0.0, tree), *tree.dof_limits_rad.T)


@lru_cache(maxsize=16)
def pose_step_sigma(tree: KinematicTree) -> np.ndarray:
    """(6 + D,) standard deviations of all coordinates of a body's step within 1 / `FPS`, in the
    order of `Pose.minus`.
    """
    if is_person_tree(tree):
        angles = _per_dof_rad(_STEP_SIGMA_DEG, 3.0, tree)
    else:
        angles = np.full(len(tree.dofs), np.radians(_ANY_STEP_DEG))
    root = [_ROOT_FIXED_SIGMA] * 6 if tree.root_fixed else [ROOT_STEP_M] * 3 + [ROOT_STEP_RAD] * 3
    return np.concatenate([root, angles])


def elapsed_steps(previous_s: float, current_s: float) -> float:
    """Time between two frames in units of 1 / `FPS`, at least half a step."""
    return max(abs(current_s - previous_s) * FPS, _SHORTEST_STEP)


def predict(
    pose: Pose, previous: Pose | None, limits_rad: np.ndarray = HUMAN.dof_limits_rad
) -> Pose:
    """Pose expected after `pose`, which followed on `previous`, at a damped constant velocity.

    Args:
        pose: the latest pose.
        previous: the pose one frame before it; None if unknown: the body is expected to stay.
        limits_rad: (D, 2) limits of the body's angles, by default those of a person.
    """
    if previous is None:
        return pose
    return pose.moved(MOMENTUM * pose.minus(previous)).clipped(limits_rad)


def neighbour_middle(before: Pose | None, pose: Pose, after: Pose | None) -> Pose:
    """Pose half way between the neighbours in time; `pose` itself where one of them is missing."""
    return pose if before is None or after is None else before.moved(0.5 * after.minus(before))
