"""A small library of made-up motion, and how it is put together."""

from dataclasses import replace
from functools import cache

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.motion.motion import Motion

SETTINGS = LibrarySettings(poses=240, yaw_step_deg=60, mirror=False, tolerance_deg=12.0)


def swaying(seed: int = 0, frames: int = 200, stature_m: float = 1.75) -> Motion:
    """Smooth motion of every joint that is not held, turning about."""
    rng = np.random.default_rng(seed)
    model = BodyModel.from_sizes(BodySizes(stature_m))
    time = np.arange(frames)[:, None] / 30
    phase, pace = rng.uniform(0, 2 * np.pi, model.dof_count), rng.uniform(0.1, 0.5, model.dof_count)
    angles = 0.45 * np.sin(2 * np.pi * pace * time + phase) + 0.2 * np.sin(5 * pace * time)
    angles = np.where(model.tree.dof_fixed, 0, np.clip(angles, *model.tree.dof_limits_rad.T))
    half = np.cumsum(rng.normal(0, 0.02, frames))
    quaternion = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    return Motion(30.0, model, np.tile(model.joints_m[0], (frames, 1)), quaternion, angles)


def small_bases(settings: LibrarySettings = SETTINGS):
    return base_poses({"first": swaying(0), "second": swaying(1)}, settings)


@cache
def small_library(**changed) -> PoseLibrary:
    """The library of `SETTINGS`, some of them changed; not to be altered."""
    settings = replace(SETTINGS, **changed)
    return build_library(small_bases(settings), swaying().model, settings)
