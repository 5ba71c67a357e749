"""Constants of posture and movement, and prediction of poses from frame to frame."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.pose import Pose
from silhouette_core.tuning import DYNAMICS

FPS = float(30)
"""Frames a second, the unit to which step sizes refer: recorded motion is used at this rate."""
MOMENTUM = DYNAMICS.momentum
ROOT_STEP_M, ROOT_STEP_RAD = DYNAMICS.root_step_m, DYNAMICS.root_step_rad

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
    "upper_arm.abduction": -30,
    "forearm.flexion": 20,
    "shin.flexion": 8,
    "thigh.flexion": 4,
}
# The same of joints that are not in the tables, and of bodies that are no person's, about which
# nothing is known.
_OTHER_USUAL_DEG, _OTHER_STEP_DEG, _ANY_USUAL_DEG, _ANY_STEP_DEG = 10, 3, 120, 12


def _per_dof_rad(
    table_deg: Mapping[str, float], default_deg: float, tree: KinematicTree = HUMAN
) -> np.ndarray:
    """(D,) radians from a table by part or by part and movement, the same for both sides."""
    values = []
    for name in tree.dof_names:
        base = name.removeprefix("left_").removeprefix("right_")
        values.append(table_deg.get(base, table_deg.get(base.partition(".")[0], default_deg)))
    return np.radians(values)


RELAXED_RAD = _per_dof_rad(_RELAXED_DEG, 0)  #: (D,) joint angles of a person's resting stance.


def is_person_tree(tree: KinematicTree) -> bool:
    """Whether a tree is a person's, perhaps with parts added."""
    return {*HUMAN.names, *HUMAN.dof_names} <= {*tree.names, *tree.dof_names}


@lru_cache(maxsize=16)
def usual_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) deviation of a body's joint angles about `relaxed_rad`, wide where it is no person's."""
    if is_person_tree(tree):
        return _per_dof_rad(_USUAL_DEG, _OTHER_USUAL_DEG, tree)
    return np.full(len(tree.dofs), np.radians(_ANY_USUAL_DEG))


@lru_cache(maxsize=16)
def relaxed_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) joint angles of a body's resting stance: of other bodies than a person's at rest, or as
    near as the limits allow.
    """
    table = _RELAXED_DEG if is_person_tree(tree) else {}
    return np.clip(_per_dof_rad(table, 0, tree), *tree.dof_limits_rad.T)


@lru_cache(maxsize=16)
def pose_step_sigma(tree: KinematicTree) -> np.ndarray:
    """(6 + D,) deviations of a body's step within 1 / `FPS`, in the order of `Pose.minus`."""
    if is_person_tree(tree):
        angles = _per_dof_rad(_STEP_SIGMA_DEG, _OTHER_STEP_DEG, tree)
    else:
        angles = np.full(len(tree.dofs), np.radians(_ANY_STEP_DEG))
    root = np.repeat([ROOT_STEP_M, ROOT_STEP_RAD], 3)
    return np.concatenate([np.full(6, 1e-5) if tree.root_fixed else root, angles])


def elapsed_steps(previous_s: float, current_s: float) -> float:
    """Time between two frames in units of 1 / `FPS`, at least half a step."""
    return max(abs(current_s - previous_s) * FPS, 0.5)


def predict(
    pose: Pose, previous: Pose | None, limits_rad: np.ndarray = HUMAN.dof_limits_rad
) -> Pose:
    """Pose expected after `pose`, which followed on `previous`, at a damped constant velocity.

    Args:
        previous: the pose one frame before it; None if unknown: the body is expected to stay.
        limits_rad: (D, 2) limits of the body's angles, by default those of a person.
    """
    if previous is None:
        return pose
    return pose.moved(MOMENTUM * pose.minus(previous)).clipped(limits_rad)
