"""Motion of a body of which none was recorded: smooth random angles within the limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.tuning import SAMPLED_MOTION
from silhouette_core.motion.dynamics import FPS, relaxed_rad
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion

_FRAMES_PER_KNOT = 15


def sampled_motion(model: BodyModel, rng: np.random.Generator, frames: int) -> Motion:
    """Smooth random motion of all joints of a body, each by itself, at `dynamics.FPS`.

    Angles are normally distributed about rest, cut off at the limits. A root that is free leans a
    little; a motion has no heading, since a library shows every pose from all sides.

    Args:
        model: the body.
        rng: random numbers.
        frames: number of poses.
    """
    rest = relaxed_rad(model.tree)
    low, high = np.where(model.tree.dof_fixed, rest, model.tree.dof_limits_rad.T)
    knots = rng.standard_normal((frames // _FRAMES_PER_KNOT + 2, model.dof_count + 2))
    drawn = knots[:, 2:] * SAMPLED_MOTION.spread
    angles = np.clip(rest + np.where(drawn < 0, rest - low, high - rest) * drawn, low, high)
    tilt = np.zeros((len(knots), 3))
    if not model.tree.root_fixed:
        tilt[:, :2] = np.radians(SAMPLED_MOTION.tilt_deg) * knots[:, :2]
    turns = Rotation.from_rotvec(_between(tilt, frames)).as_matrix()
    root = np.tile(model.joints_m[0], (frames, 1))
    return Motion(FPS, model, root, quaternions(turns), _between(angles, frames))


def _between(knots: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """Values (T, n) that pass through knots (K, n) and never beyond their neighbours."""
    times = np.arange(len(knots)) * _FRAMES_PER_KNOT
    return np.asarray(PchipInterpolator(times, knots)(np.arange(frames)))
