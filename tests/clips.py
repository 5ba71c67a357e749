"""Motions for tests, made without an estimator."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.motion import Motion

FIRST_SUMMARY = {
    "voxelpose": "0.1.0",
    "estimator": "multiview",
    "recording": "walk",
    "fps": 25.0,
    "cameras": ["cam_1"],
    "frames": {"first": 0, "last": 5, "with_pose": 5, "lost": [3]},
    "body": {"stature_m": 1.7, "chest_girth_m": None, "sex": "unknown"},
    "quality": {
        "unexplained": {"min": 0.0, "median": 0.1, "max": 0.2},
        "part_overlap": {"pelvis": 0.9},
    },
    "seconds": {"pictures": 1.0, "total": 3.0, "stages": {"hulls": {"sum": 1.0}}},
}
"""summary.json of a result of the first version."""


def waving_couple(count: int = 6, fps: float = 25.0) -> list[Motion]:
    """Two who wave beside each other; the second one, of 1.6 m, is not there in the first two
    frames.
    """
    other = waving(count, 1.6, fps)
    other = replace(other, root_m=other.root_m + np.array([1.1, 0.0, 0.0]))
    return [waving(count, 1.7, fps), other.select(np.arange(2, count))]


def waving(count: int = 6, stature_m: float = 1.7, fps: float = 25.0) -> Motion:
    """Walks ahead while turning, the right arm raised and the left knee bent: no left-right
    symmetry hides a mistake.
    """
    model = _body(stature_m)
    angles = np.zeros((count, model.dof_count))
    phase = np.linspace(0, 1, count)
    for name, from_deg, to_deg in (
        ("right_upper_arm.abduction", 20, 120),
        ("right_forearm.flexion", 60, 10),
        ("left_thigh.flexion", 0, 50),
        ("left_shin.flexion", 5, 80),
        ("lumbar.flexion", 0, 15),
        ("thorax.rotation", -10, 10),
        ("neck.rotation", 0, 30),
    ):
        angles[:, model.tree.dof_names.index(name)] = np.radians(
            from_deg + phase * (to_deg - from_deg)
        )
    yaw = np.radians(30 + 60 * phase) / 2
    quaternion = np.column_stack([np.cos(yaw), np.zeros((count, 2)), np.sin(yaw)])
    root = model.joints_m[0] + np.column_stack([0.1 * phase, -0.5 * phase, 0.02 * phase])
    quality = {
        "part_overlap": np.tile(np.linspace(0.5, 1, len(model.names)), (count, 1)),
        "unexplained": 0.1 * phase,
    }
    return Motion(fps, model, root, quaternion, angles, quality=quality)


def turning(count: int = 60) -> Motion:
    """Turns twice about the vertical, the last half turn head over heels, while an arm rises past
    the horizontal: every triple of angles leaves its usual range.
    """
    take, share = waving(count), np.linspace(0, 1, count)[:, None]
    yaw = Rotation.from_euler("z", 720 * share, degrees=True)
    over = Rotation.from_euler("x", 180 * np.clip(4 * share - 3, 0, 1), degrees=True)
    # Signs as SciPy has them: of either, since both mean the same.
    return replace(take, root_quaternion=(yaw * over).as_quat(scalar_first=True))


def walking(count: int = 90, stature_m: float = 1.7, fps: float = 25.0) -> Motion:
    """Walks ahead, to -y, on stiff legs: 1.1 s a stride, of which a foot stands for 62 %."""
    model = _body(stature_m)
    angles, phase = np.zeros((count, model.dof_count)), np.arange(count) / fps / 1.1
    for side, start in (("left", 0.0), ("right", 0.5)):
        swing_deg = np.interp((phase - start) % 1, (0, 0.62, 1), (25, -25, 25))
        angles[:, model.tree.dof_names.index(f"{side}_thigh.flexion")] = np.radians(swing_deg)
    stride_m = 2 * 0.9 * np.sin(np.radians(25)) * stature_m / 2 / 0.62
    root = model.joints_m[0] + np.column_stack([0 * phase, stride_m * (1.5 - phase), 0 * phase])
    upright = np.tile([1.0, 0, 0, 0], (count, 1))
    quality = {"joint_error_mm": np.full((count, 15), 10.0)}
    return Motion(fps, model, root, upright, angles, quality=quality)


@cache
def _body(stature_m: float) -> BodyModel:
    return BodyModel.from_sizes(BodySizes(stature_m))
