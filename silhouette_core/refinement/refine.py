"""Continuous refinement: the body's surface fitted to silhouettes by robust Gauss-Newton steps.

Beyond Iiyama, Kameda and Minoh, whose method ends with the best sampled angles. There are two kinds
of residual, both in metres: a contour point's tangent plane should be touched by the surface point
nearest to its viewing ray (articulated iterative closest points on contours), and no surface point
should project outside a silhouette. Correspondences change with every step, which is why the loop
is written out here: a general least-squares solver would evaluate each step on outdated ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import RELAXED_RAD, USUAL_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.kernels.refine import (
    add_normal_equations,
    match_contours,
    measure_outside,
)
from silhouette_core.refinement.landmark_prior import LandmarkPrior, add_landmark_prior
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.surface import PosedSurface, Surface

_LIMIT_RAD = np.radians(3.0)
_OUTSIDE_M = 0.15  # scale of the robust weight of points outside a silhouette
_TRUST_M, _TRUST_RAD = 0.10, 0.35  # largest step: beyond it the correspondences change


@dataclass(frozen=True)
class RefineSettings:
    """Steps and weights of the refinement.

    Attributes:
        reaches_m: largest accepted distance between contour and surface, one entry per step, m.
        contour_m: standard deviation of a contour residual with the right correspondence, m.
        independence: fraction of contour points that count as independent of their neighbours.
        outside_weight: weight of a surface point outside a silhouette, relative to a contour point.
        usual: weight of the prior around the resting stance.
    """

    # fmt: off
    reaches_m: tuple[float, ...] = (
        0.30, 0.25, 0.20, 0.17, 0.14, 0.12, 0.10, 0.08, 0.07, 0.06, 0.06, 0.06,
    )
    # fmt: on
    contour_m: float = 0.012
    independence: float = 0.25
    outside_weight: float = 0.5
    usual: float = 1.0


@dataclass(frozen=True, eq=False)
class PosePrior:
    """Gaussian prior of the pose.

    Attributes:
        pose: the mean.
        sigma: (6 + D,) float64, standard deviations in the order of `Pose.moved`, m and rad;
            infinite where nothing is known.
    """

    pose: Pose
    sigma: np.ndarray


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals between a posed surface and the silhouettes, N of them.

    Attributes:
        index: (N,) int64, surface point of each residual.
        direction: (N, 3) float64, world direction along which the residual is measured.
        gap_m: (N,) float64, the residual.
        weight: (N,) float64, its robust weight, 1/m².
        explained: fraction of contour points with a surface point within reach.
    """

    index: np.ndarray
    direction: np.ndarray
    gap_m: np.ndarray
    weight: np.ndarray
    explained: float


@dataclass(frozen=True)
class RefinedPose:
    """Result of a refinement.

    Attributes:
        pose: the refined pose.
        rms_m: root mean square of the residuals, robustly weighted, m.
        explained: fraction of contour points with a surface point within reach.
        normal_matrix: (6 + D, 6 + D) float64, of the last step's normal equations.
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
    landmark_prior: LandmarkPrior | None = None,
) -> RefinedPose:
    r"""Fits the pose of a body to one frame's silhouettes.

    Each of the steps :math:`\delta` (6 + D,) solves the Gauss-Newton normal equations

    .. math:: (J^T W J + \Lambda)\, \delta = -(J^T W r + \Lambda\, (x - \mu))

    within bounds, with the residuals :math:`r` (N,) in metres and their weights :math:`W` from
    `residuals`, :math:`J` (N, 6 + D) their derivatives by root position, root rotation and joint
    angles, and :math:`\Lambda, \mu` from the priors.

    Args:
        surface: the body's sampled surface.
        observation: the frame.
        start: initial pose, right to within about 0.3 m at every joint.
        prior: prior of the pose, for example from the previous frame.
        settings: weights and reaches. A reach of 0 leaves the contour out.
        landmark_prior: prior of the joints' positions, for example from a proposal.

    Source: textbook Gauss-Newton with iteratively reweighted least squares; own correspondences.
    """
    settings = settings or RefineSettings()
    model = surface.model
    free = np.concatenate([np.arange(6), 6 + np.flatnonzero(~model.dof_fixed)])
    pose = start
    rows = Residuals(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0), 0.0)
    matrix = np.eye(6 + model.dof_count)
    for reach in settings.reaches_m:
        posed = surface.posed(pose)
        matrix, gradient = np.zeros_like(matrix), np.zeros(len(matrix))
        if reach:
            rows = residuals(surface, posed, observation, reach, settings)
            jacobian = surface.jacobian(posed, rows.index, rows.direction)
            add_normal_equations(jacobian, rows.weight, rows.gap_m, matrix, gradient)
        add_pose_priors(matrix, gradient, pose, model, prior, settings.usual)
        if landmark_prior is not None:
            add_landmark_prior(matrix, gradient, model, posed, landmark_prior)
        pose = pose.moved(bounded_step(matrix, gradient, free, pose.angles_rad, model)).clipped()
    contour = np.average(rows.gap_m**2, weights=rows.weight) if len(rows.gap_m) else np.inf
    return RefinedPose(pose, float(np.sqrt(contour)), rows.explained, matrix)


def bounded_step(
    matrix: np.ndarray, gradient: np.ndarray, free: np.ndarray, angles: np.ndarray, model: BodyModel
) -> np.ndarray:
    r"""Step that minimises the normal equations' quadratic in joint limits and a trust region.

    .. math:: \min_\delta \tfrac{1}{2} \delta^T H \delta + g^T \delta
        \quad \text{subject to} \quad l \le \delta \le u

    solved by fixing unknowns at the bounds that they violate, until none does. Clipping the
    unbounded step instead would separate rotations that compensate each other, such as those of
    pelvis and lumbar spine.

    Args:
        matrix: (n, n) float64, H, positive definite on the free unknowns; n = 6 + D or more.
        gradient: (n,) float64, g.
        free: indices of the unknowns that may change.
        angles: (D,) float64, current joint angles, rad.
        model: for the limits.

    Returns:
        (n,) float64, the step; zero where not free.
    """
    count = len(gradient)
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    low[:3], high[:3] = -_TRUST_M, _TRUST_M
    low[3:6], high[3:6] = -_TRUST_RAD, _TRUST_RAD
    dofs = slice(6, 6 + len(angles))
    # An angle that starts beyond its limit may return by as much as the trust region allows.
    low[dofs] = np.minimum(np.maximum(model.dof_limits_rad[:, 0] - angles, -_TRUST_RAD), 0.0)
    high[dofs] = np.maximum(np.minimum(model.dof_limits_rad[:, 1] - angles, _TRUST_RAD), 0.0)
    step, moving = np.zeros(count), free
    while len(moving):
        factor = cho_factor(matrix[np.ix_(moving, moving)] + 1e-6 * np.eye(len(moving)))
        solved = -cho_solve(factor, gradient[moving] + matrix[moving] @ step)
        bounded = np.clip(solved, low[moving], high[moving])
        violated = bounded != solved
        if not violated.any():
            step[moving] = solved
            break
        step[moving[violated]] = bounded[violated]
        moving = moving[~violated]
    return step


def residuals(
    surface: Surface,
    posed: PosedSurface,
    observation: Observation,
    reach_m: float,
    settings: RefineSettings,
) -> Residuals:
    r"""Contour and outside residuals of a posed surface, with robust weights.

    .. math::

        r_i = n_i \cdot (p_i - c_i), \qquad
        w_i = \frac{\rho}{\sigma^2} \left(1 + r_i^2 / s^2\right)^{-2}

    for a contour point with tangent plane normal :math:`n_i`, camera centre :math:`c_i` and matched
    surface point :math:`p_i` (m); :math:`\sigma` is `contour_m`, :math:`\rho` `independence`. For a
    surface point outside a silhouette, r is its distance from the silhouette at its depth.

    Args:
        surface: the body's sampled surface.
        posed: the same in its current pose.
        observation: the frame.
        reach_m: largest accepted distance between contour and surface.
        settings: weights.

    Source: weights of Geman and McClure (1987); correspondences own.
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
    hits = np.flatnonzero(matched >= 0)
    scale = max(0.5 * reach_m, 2 * settings.contour_m)
    base = settings.independence / settings.contour_m**2
    index, direction, gaps = [matched[hits]], [observation.normal[hits]], [gap[hits]]
    weight = [base / (1 + (gap[hits] / scale) ** 2) ** 2]
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
        weight.append(settings.outside_weight * base / (1 + (away[out] / _OUTSIDE_M) ** 2) ** 2)
    explained = len(hits) / max(count, 1)
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
    """Adds the priors to the normal equations, in place: resting stance, joint limits, given prior.

    Args:
        matrix: (6 + D, 6 + D) float64.
        gradient: (6 + D,) float64.
        pose: the current pose.
        model: for the limits.
        prior: prior of the pose.
        usual: weight of the resting stance.
    """
    diagonal = np.zeros(len(gradient))
    angles = pose.angles_rad
    precision = usual / USUAL_RAD**2
    diagonal[6:] += precision
    gradient[6:] += precision * (angles - RELAXED_RAD)
    low, high = model.dof_limits_rad.T
    beyond = np.where(angles < low, angles - low, np.where(angles > high, angles - high, 0.0))
    precision = np.where(beyond != 0, 1 / _LIMIT_RAD**2, 0.0)
    diagonal[6:] += precision
    gradient[6:] += precision * beyond
    if prior is not None:
        precision = 1 / prior.sigma**2
        diagonal += precision
        gradient += precision * pose.minus(prior.pose)
    matrix[np.diag_indices(len(gradient))] += diagonal
