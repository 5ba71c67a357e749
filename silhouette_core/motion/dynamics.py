"""Constants of posture and movement, and prediction of poses from frame to frame."""

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from silhouette_core.body.joints import HUMAN, without_side
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.pose import Pose
from silhouette_core.tuning import DYNAMICS

FPS = float(30)
"""Frames a second, the unit to which step sizes refer: recorded motion is used at this rate."""
MOMENTUM = DYNAMICS.momentum
ROOT_STEP_M, ROOT_STEP_RAD = DYNAMICS.root_step_m, DYNAMICS.root_step_rad

_DEGREES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def _per_dof_rad(
    table_deg: Mapping[str, float], default_deg: float, tree: KinematicTree = HUMAN
) -> np.ndarray:
    """(D,) radians from a table by part or by part and movement, the same for both sides."""
    values = []
    for name in tree.dof_names:
        base = without_side(name)
        values.append(table_deg.get(base, table_deg.get(base.partition(".")[0], default_deg)))
    return np.radians(values)


RELAXED_RAD = _per_dof_rad(
    _DEGREES["relaxed"], 0
)  #: (D,) joint angles of a person's resting stance.


def is_person_tree(tree: KinematicTree) -> bool:
    """Whether a tree is a person's, perhaps with parts added."""
    return {*HUMAN.names, *HUMAN.dof_names} <= {*tree.names, *tree.dof_names}


@lru_cache(maxsize=16)
def usual_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) deviation of a body's joint angles about `relaxed_rad`, wide where it is no person's."""
    if is_person_tree(tree):
        return _per_dof_rad(_DEGREES["usual"], _DEGREES["usual_of_others"], tree)
    return np.full(len(tree.dofs), np.radians(_DEGREES["usual_of_other_bodies"]))


@lru_cache(maxsize=16)
def relaxed_rad(tree: KinematicTree) -> np.ndarray:
    """(D,) joint angles of a body's resting stance: of other bodies than a person's at rest, or as
    near as the limits allow.
    """
    table = _DEGREES["relaxed"] if is_person_tree(tree) else {}
    return np.clip(_per_dof_rad(table, 0, tree), *tree.dof_limits_rad.T)


@lru_cache(maxsize=16)
def pose_step_sigma(tree: KinematicTree) -> np.ndarray:
    """(6 + D,) deviations of a body's step within 1 / `FPS`, in the order of `Pose.minus`."""
    if is_person_tree(tree):
        angles = _per_dof_rad(_DEGREES["step"], _DEGREES["step_of_others"], tree)
    else:
        angles = np.full(len(tree.dofs), np.radians(_DEGREES["step_of_other_bodies"]))
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
