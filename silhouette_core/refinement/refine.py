"""Continuous refinement: the body's surface drawn onto every silhouette by robust Gauss-Newton
steps.

Beyond paper B, which ends with the best sampled angles. Two kinds of residual, both in metres: a
contour point's tangent plane should be touched by the surface point nearest to its viewing ray
(articulated iterative closest points on contours), and no surface point
should project outside a silhouette. Correspondences change with every step, which is why the loop
is written out here: a general least-squares solver would evaluate each step on stale ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from silhouette_core.body.model import BodyModel
from silhouette_core.refinement.kernels.refine import (
    add_normal_equations,
    match_contours,
    measure_outside,
)
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.pose import RELAXED_RAD, USUAL_RAD, Pose
from silhouette_core.refinement.surface import PosedSurface, Surface

_LIMIT_RAD = np.radians(3.0)
_TRUST_M, _TRUST_RAD = (
    0.10,
    0.35,
)  # farthest that one step goes: beyond it the correspondences are other ones


@dataclass(frozen=True)
class RefineSettings:
    """How the refinement weighs what it sees.

    Attributes:
        reaches_m: farthest accepted distance between contour and surface, one entry per step.
        contour_m: standard deviation of a contour residual that is right.
        independence: share of contour points that count as independent of their neighbours.
        outside_weight: weight of a surface point outside a silhouette, relative to a contour point.
        usual: weight of the prior around the resting stance.
    """

    reaches_m: tuple[float, ...] = (
        0.30,
        0.25,
        0.20,
        0.17,
        0.14,
        0.12,
        0.10,
        0.08,
        0.07,
        0.06,
        0.06,
        0.06,
    )
    contour_m: float = 0.012
    independence: float = 0.25
    outside_weight: float = 0.5
    usual: float = 1.0


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A Gaussian belief about the pose: where it should be and how sure that is.

    Attributes:
        pose: the expected pose.
        sigma: (6 + D,) standard deviations; infinite where nothing is expected.
    """

    pose: Pose
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class Residuals:
    """What still separates a posed surface from the silhouettes. N rows.

    Attributes: index: (N,) surface points, direction: (N, 3) world directions in which each is off,
        gap_m: (N,) by how much, weight: (N,). explained: share of contour points that found a
        surface point within reach.
    """

    index: np.ndarray
    direction: np.ndarray
    gap_m: np.ndarray
    weight: np.ndarray
    explained: float


@dataclass(frozen=True)
class Refined:
    """A refined pose with the root mean square of its contour gaps (m, robustly weighted) and the
    share of contour explained.
    """

    pose: Pose
    rms_m: float
    explained: float
    normal_matrix: np.ndarray = field(repr=False)


def refine(
    surface: Surface,
    observation: Observation,
    start: Pose,
    prior: PosePrior | None = None,
    settings: RefineSettings | None = None,
) -> Refined:
    """Draws the body onto one frame's silhouettes.

    Args:
        surface: the body's sampled surface.
        observation: the frame.
        start: first guess, right to within about 0.3 m at every joint.
        prior: what else is believed about the pose, for example from the frame before.
        settings: weights and reaches.
    """
    settings = settings or RefineSettings()
    model = surface.model
    free = np.concatenate([np.arange(6), 6 + np.flatnonzero(~model.dof_fixed)])
    pose = start
    rows = Residuals(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0), 0.0)
    matrix = np.eye(6 + model.dof_count)
    for reach in settings.reaches_m:
        posed = surface.posed(pose)
        rows = residuals(surface, posed, observation, reach, settings)
        jacobian = surface.jacobian(posed, rows.index, rows.direction)
        matrix, gradient = (
            np.zeros((6 + model.dof_count, 6 + model.dof_count)),
            np.zeros(6 + model.dof_count),
        )
        add_normal_equations(jacobian, rows.weight, rows.gap_m, matrix, gradient)
        add_pose_priors(matrix, gradient, pose, model, prior, settings.usual)
        pose = pose.moved(bounded_step(matrix, gradient, free, pose.angles_rad, model)).clipped()
    contour = np.average(rows.gap_m**2, weights=rows.weight) if len(rows.gap_m) else np.inf
    return Refined(pose, float(np.sqrt(contour)), rows.explained, matrix)


def bounded_step(
    matrix: np.ndarray, gradient: np.ndarray, free: np.ndarray, angles: np.ndarray, model: BodyModel
) -> np.ndarray:
    """Minimises the quadratic of the normal equations within joint limits and a trust region.

    Clipping a free step instead would tear apart turns that only balance each other together, as
    pelvis and lumbar do.

    Args:
        matrix: (n, n) and gradient (n,), n = 6 + D or more: positive definite on the free unknowns.
        free: unknowns that may move.
        angles: (D,) the present joint angles.
        model: for the limits.

    Returns:
        (n,) the step; zero where not free.
    """
    count = len(gradient)
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    low[:3], high[:3] = -_TRUST_M, _TRUST_M
    low[3:6], high[3:6] = -_TRUST_RAD, _TRUST_RAD
    dofs = slice(6, 6 + len(angles))
    # An angle beyond its limit (a start from elsewhere) may return at the pace of the trust region.
    low[dofs] = np.minimum(np.maximum(model.dof_limits_rad[:, 0] - angles, -_TRUST_RAD), 0.0)
    high[dofs] = np.maximum(np.minimum(model.dof_limits_rad[:, 1] - angles, _TRUST_RAD), 0.0)
    step, moving = np.zeros(count), free
    while len(moving):
        rest = gradient[moving] + matrix[moving] @ step
        solved = -cho_solve(
            cho_factor(matrix[np.ix_(moving, moving)] + 1e-6 * np.eye(len(moving))), rest
        )
        bounded = np.clip(solved, low[moving], high[moving])
        stopped = bounded != solved
        if not stopped.any():
            step[moving] = solved
            break
        step[moving[stopped]] = bounded[stopped]
        moving = moving[~stopped]
    return step


def residuals(
    surface: Surface,
    posed: PosedSurface,
    observation: Observation,
    reach_m: float,
    settings: RefineSettings,
) -> Residuals:
    """Collects the contour and outside residuals of a posed surface, with robust (Geman-McClure)
    weights.
    """
    count = len(observation.camera)
    matched, gap = np.empty(count, np.int64), np.empty(count)
    views = observation.views
    match_contours(
        observation.camera,
        views.center_m,
        observation.ray,
        observation.normal,
        posed.points,
        posed.normals,
        reach_m,
        matched,
        gap,
    )
    found = np.flatnonzero(matched >= 0)
    scale = max(0.5 * reach_m, 2 * settings.contour_m)
    base = settings.independence / settings.contour_m**2
    index, direction, gaps = [matched[found]], [observation.normal[found]], [gap[found]]
    weight = [base / (1 + (gap[found] / scale) ** 2) ** 2]
    away, toward = np.empty(len(posed.points)), np.empty((len(posed.points), 3))
    for c, outside in enumerate(observation.outside_px):
        measure_outside(
            posed.points,
            views.intrinsics[c],
            views.rotation[c],
            views.translation_m[c],
            outside,
            away,
            toward,
        )
        out = np.flatnonzero(away > 0)
        index.append(out)
        direction.append(toward[out])
        gaps.append(away[out])
        weight.append(settings.outside_weight * base / (1 + (away[out] / 0.15) ** 2) ** 2)
    explained = len(found) / max(count, 1)
    return Residuals(
        np.concatenate(index),
        np.concatenate(direction),
        np.concatenate(gaps),
        np.concatenate(weight),
        explained,
    )


def add_pose_priors(
    matrix: np.ndarray,
    gradient: np.ndarray,
    pose: Pose,
    model: BodyModel,
    prior: PosePrior | None,
    usual: float,
) -> None:
    """Adds to the normal equations what is believed without looking: stance, joint limits, and the
    given prior. In place.
    """
    diagonal = np.zeros(len(gradient))
    angles = pose.angles_rad
    stance = usual / USUAL_RAD**2
    diagonal[6:] += stance
    gradient[6:] += stance * (angles - RELAXED_RAD)
    low, high = model.dof_limits_rad.T
    beyond = np.where(angles < low, angles - low, np.where(angles > high, angles - high, 0.0))
    stiff = np.where(beyond != 0, 1 / _LIMIT_RAD**2, 0.0)
    diagonal[6:] += stiff
    gradient[6:] += stiff * beyond
    if prior is not None:
        precision = 1 / prior.sigma**2
        diagonal += precision
        gradient += precision * pose.minus(prior.pose)
    matrix[np.diag_indices(len(gradient))] += diagonal
