"""Joint refinement of consecutive poses: contours, priors and the motion between frames at once.

Beyond paper A. What one silhouette leaves open, mostly depth, is decided by the frames around it:
accelerations are small, and a foot that stands does not move.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from calib.checks import FloatArray, IntArray
from silhouette_core.body.model import BodyModel
from silhouette_core.jit import one_thread
from silhouette_core.motion.dynamics import FPS, pose_step_sigma
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.pose import JointTarget, Pose, PoseArrays, steps_of
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.kernels.refine import add_normal_equations
from silhouette_core.refinement.kernels.steps import move_poses
from silhouette_core.refinement.landmark_prior import (
    LandmarkPrior,
    add_landmark_priors,
    add_targets,
    landmark_arrays,
    landmark_jacobian,
)
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import (
    RefineSettings,
    add_pose_priors,
    add_silhouettes,
    contour_weights,
    free_unknowns,
    pose_arrays,
    step_bounds,
)
from silhouette_core.refinement.surface import PosedSurface, Surface
from silhouette_core.tuning import REFINEMENT, TRAJECTORY

_ANKLES = "left_ankle", "right_ankle"


@dataclass(frozen=True, eq=False)
class FrameEvidence:
    """What a frame says of its pose."""

    observation: Observation
    time_s: float
    landmark_prior: LandmarkPrior | None = None  #: of the joints' positions; None: there is none.
    scale: float = 1.0
    """Factor on the standard deviation of contour residuals, of a frame whose silhouettes are worse
    than usual."""
    targets: Sequence[JointTarget] = ()  #: joints that somebody set by hand.


def fit_trajectory(
    surface: Surface,
    frames: Sequence[FrameEvidence],
    poses: Sequence[Pose],
    floor: bool,
    live: bool = False,
    before: Sequence[Pose] = (),
) -> list[Pose]:
    r"""Refines the poses of T consecutive frames together.

    Gauss-Newton steps on the sum of every frame's own terms (`refine.residuals` and the priors) and

    .. math:: \sum_t \sum_i \frac{(x_{t+1,i} - 2 x_{t,i} + x_{t-1,i})^2}{2 \sigma_i^2}

    over all coordinates :math:`i` of the pose, with standing feet and the floor beside it. The
    normal equations are block-banded, two frames to either side, and solved by one banded Cholesky
    factorisation.

    Args:
        frames: T frames, their times increasing.
        poses: T poses to start from.
        floor: whether z = 0 is the floor.
        live: whether a camera is kept up with: one round less.
        before: up to two poses of the frames before the first, which stay as they are.

    Returns:
        T poses.

    Source: textbook sparse Gauss-Newton (bundle adjustment over time).
    """
    model = surface.model
    contour = RefineSettings(REFINEMENT.near_reaches_m[live:])
    poses, fixed = list(poses), list(before)
    free = free_unknowns(model)
    if model.tree.root_fixed:
        free = free[6:]
    time_s = np.array([frame.time_s for frame in frames])
    priors = landmark_arrays([frame.landmark_prior for frame in frames], len(model.landmarks_m))
    size, count = len(free), len(poses)
    sigma = TRAJECTORY.acceleration * pose_step_sigma(model.tree)
    if model.person is None:
        sigma[6:] *= TRAJECTORY.other_acceleration / TRAJECTORY.acceleration
    for reach in contour.reaches_m:
        arrays = PoseArrays.from_poses(poses)
        together = surface.posed_many(arrays)
        matrix, gradient = _own_terms(
            surface, together, frames, arrays, priors, floor, reach, contour
        )
        banded = _Banded(count, size)
        for t in range(count):
            banded.add(t, t, matrix[t][np.ix_(free, free)])
        banded.gradient += gradient[:, free]
        _add_accelerations(banded, [*fixed, *poses], len(fixed), time_s, sigma[free], free)
        if floor and count > 1:
            _add_standing(banded, model, together, free)
        low, high = step_bounds(arrays.angles_rad, model)
        change = np.zeros((count, 6 + model.dof_count))
        change[:, free] = banded.solve(low[:, free], high[:, free])
        move_poses(change, model.tree.dof_limits_rad, *arrays.arrays)
        poses = arrays.poses()
    return poses


class _Banded:
    """Normal equations of T frames of n unknowns, each coupled with the next two."""

    def __init__(self, count: int, size: int):
        self.count, self.size = count, size
        self.bands = np.zeros((min(3, count) * size, count * size))  # lower form
        self.gradient = np.zeros((count, size))

    def add(self, row: int, column: int, block: FloatArray) -> None:
        """Adds a block (n, n) at frames row >= column."""
        size, below = self.size, (row - column) * self.size
        for k in range(size):
            first = 0 if row > column else k
            offset = below + first - k
            self.bands[offset : offset + size - first, column * size + k] += block[first:, k]

    def solve(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Steps (T, n) between bounds: as `refine.solve_steps`, unknowns are fixed at the bounds
        that they violate, until none does.
        """
        self.bands[0] += 1e-6
        held = np.zeros(self.gradient.size, np.bool_)
        low, high, gradient = low.ravel(), high.ravel(), self.gradient.ravel()
        stiff = 1e9 * self.bands[0].max()
        while True:
            steps = -solveh_banded(self.bands, gradient, lower=True)
            beyond = ~held & ((steps < low) | (steps > high))
            if not beyond.any():
                return np.clip(steps, low, high).reshape(self.count, self.size)
            bound = np.clip(steps, low, high)[beyond]
            self.bands[0, beyond] += stiff
            gradient[beyond] -= stiff * bound
            held |= beyond


def _own_terms(
    surface: Surface,
    posed: PosedSurface,
    frames: Sequence[FrameEvidence],
    poses: PoseArrays,
    landmark_priors: tuple[np.ndarray, ...],
    floor: bool,
    reach_m: float,
    contour: RefineSettings,
) -> tuple[FloatArray, FloatArray]:
    """Normal equations (T, n, n) and (T, n) of every frame alone."""
    model, count = surface.model, len(poses)
    matrix = np.zeros((count, 6 + model.dof_count, 6 + model.dof_count))
    gradient, reach = np.zeros(matrix.shape[:2]), np.array([reach_m])
    weights = contour_weights([contour], reach)

    def add(t: int) -> None:
        rows = slice(t, t + 1)
        scaled = weights * [1, frames[t].scale ** -2, frames[t].scale ** -2]
        with one_thread():
            observation, one = frames[t].observation, posed[rows]
            add_silhouettes(surface, one, observation, reach, scaled, matrix[rows], gradient[rows])
            if floor:
                _add_floor(matrix[t], gradient[t], surface, posed[t])
        if frames[t].targets:
            add_targets(matrix[t], gradient[t], model, posed[t], frames[t].targets)

    for _ in side_by_side(add, range(count)):
        pass
    stances = [contour.usual] * count
    usual = pose_arrays(poses, [None] * count, stances, model.tree)
    add_pose_priors(matrix, gradient, poses, model, usual)
    add_landmark_priors(matrix, gradient, model, posed, landmark_priors)
    return matrix, gradient


def _add_floor(
    matrix: FloatArray, gradient: FloatArray, surface: Surface, posed: PosedSurface
) -> None:
    """Adds the height of what is below the floor, and of the lowest point if it is a little above:
    with the outline, it decides the distance.
    """
    height = posed.points[:, 2]
    touching = np.flatnonzero(height < 0)
    if not len(touching):
        touching = np.array([height.argmin()])
    up = np.tile([0.0, 0.0, 1.0], (len(touching), 1))
    # All points together count as one: they are of one foot.
    weight = 1.0 / (TRAJECTORY.foot_m**2 * len(touching))
    above = np.maximum(height[touching], 0.0) / (0.5 * TRAJECTORY.stand_m)
    add_normal_equations(
        surface.jacobian(posed, touching, up),
        weight / (1 + above**2) ** 2,
        height[touching],
        matrix,
        gradient,
    )


def _add_accelerations(
    banded: _Banded,
    poses: list[Pose],
    fixed: int,
    time_s: FloatArray,
    sigma: FloatArray,
    free: IntArray,
) -> None:
    """Adds the second differences; the first `fixed` poses are not unknowns."""
    if len(poses) < 3:
        return
    interval = np.median(np.diff(time_s)) if len(time_s) > 1 else 1 / FPS
    # A second difference grows with the square of the interval.
    precision = 1 / (sigma * max(interval * FPS, 0.25) ** 2) ** 2
    steps_between = steps_of(PoseArrays.from_poses(poses))[:, free]
    for middle in range(1, len(poses) - 1):
        first = middle - 1 - fixed
        if first >= -fixed and first + 2 < len(time_s) and first >= 0:
            steps = np.diff(time_s[first : first + 3])
            if steps.max() > 1.5 * interval:
                continue  # frames are missing
        change = steps_between[middle] - steps_between[middle - 1]
        for a, factor_a in enumerate((1.0, -2.0, 1.0)):
            if first + a < 0:
                continue
            banded.gradient[first + a] += factor_a * precision * change
            for b, factor_b in enumerate((1.0, -2.0, 1.0)):
                if 0 <= first + b <= first + a:
                    banded.add(first + a, first + b, np.diag(factor_a * factor_b * precision))


def _add_standing(banded: _Banded, model: BodyModel, posed: PosedSurface, free: IntArray) -> None:
    """Adds the movement of feet near the floor: robust, so that a swinging foot is free."""
    names = model.tree.landmark_names
    feet = [names.index(name) for name in _ANKLES if name in names]
    ankles = landmarks(model, posed.part_rotation, posed.part_origin)[:, feet]
    jacobians = [landmark_jacobian(model, posed[t])[feet][..., free] for t in range(len(ankles))]
    for t in range(len(ankles) - 1):
        moved = ankles[t + 1] - ankles[t]
        for foot in range(len(feet)):
            if max(ankles[t, foot, 2], ankles[t + 1, foot, 2]) > TRAJECTORY.stand_m:
                continue
            speed = float(moved[foot] @ moved[foot]) / TRAJECTORY.foot_m**2
            weight = 1.0 / ((TRAJECTORY.still * TRAJECTORY.foot_m) ** 2 * (1 + speed) ** 2)
            first, second = -jacobians[t][foot], jacobians[t + 1][foot]
            banded.add(t, t, weight * first.T @ first)
            banded.add(t + 1, t, weight * second.T @ first)
            banded.add(t + 1, t + 1, weight * second.T @ second)
            banded.gradient[t] += weight * first.T @ moved[foot]
            banded.gradient[t + 1] += weight * second.T @ moved[foot]
