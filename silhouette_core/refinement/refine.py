"""Continuous refinement: the body's surface fitted to silhouettes by robust Gauss-Newton steps.

Beyond Iiyama, Kameda and Minoh, whose method ends with the best sampled angles. There are two kinds
of residual, both in metres: a contour point's tangent plane should be touched by the surface point
nearest to its viewing ray (articulated iterative closest points on contours), and no surface point
should project outside a silhouette. Correspondences change with every step, which is why the loop
is written out here: a general least-squares solver would evaluate each step on outdated ones.
"""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field

import numpy as np

from silhouette_core.body.joints import HUMAN
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.jit import one_thread
from silhouette_core.motion.dynamics import relaxed_rad, usual_rad
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.kernels.contours import match_contours
from silhouette_core.refinement.kernels.refine import add_silhouette_terms, measure_outside
from silhouette_core.refinement.kernels.steps import add_pose_terms, bounded_steps, move_poses
from silhouette_core.refinement.landmark_prior import (
    LandmarkPrior,
    add_landmark_priors,
    landmark_arrays,
)
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.surface import PosedSurface, Surface
from silhouette_core.tuning import REFINEMENT


@dataclass(frozen=True)
class RefineSettings:
    """Steps and weights of the refinement."""

    reaches_m: tuple[float, ...] = REFINEMENT.reaches_m(REFINEMENT.searched_m)
    """Largest accepted distance between contour and surface, one entry per step, m."""
    contour_m: float = REFINEMENT.contour_m
    """Standard deviation of a contour residual with the right correspondence, m."""
    independence: float = REFINEMENT.independence
    """Fraction of contour points that count as independent of their neighbours."""
    usual: float = 1.0  #: weight of the prior around the resting stance.


@dataclass(frozen=True, eq=False)
class PosePrior:
    """Gaussian prior of the pose."""

    pose: Pose  #: the mean.
    sigma: np.ndarray
    """(6 + D,) float64, standard deviations in the order of `Pose.moved`, m and rad; infinite where
    nothing is known."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals between a posed surface and the silhouettes, N of them."""

    index: np.ndarray  #: (N,) int64, surface point of each residual.
    direction: np.ndarray  #: (N, 3) float64, world direction along which the residual is measured.
    gap_m: np.ndarray  #: (N,) float64, the residual.
    weight: np.ndarray  #: (N,) float64, its robust weight, 1/m².


@dataclass(frozen=True)
class RefinedPose:
    """Result of a refinement."""

    pose: Pose
    normal_matrix: np.ndarray = field(repr=False)
    """(6 + D, 6 + D) float64, of the last step's normal equations."""


@dataclass(frozen=True, eq=False)
class RefineStart:
    """Where a refinement starts, and what is believed; see `refine`."""

    pose: Pose
    settings: RefineSettings
    prior: PosePrior | None = None
    landmark_prior: LandmarkPrior | None = None


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
        start: initial pose, right to within about 0.3 m at every joint.
        prior: prior of the pose, for example from the previous frame.
        settings: weights and reaches. A reach of 0 leaves the contour out.
        landmark_prior: prior of the joints' positions, for example from a proposal.

    Source: textbook Gauss-Newton with iteratively reweighted least squares; own correspondences.
    """
    settings = settings or RefineSettings()
    one = RefineStart(start, settings, prior, landmark_prior)
    return refine_many(surface, observation, [one])[0]


def refine_many(
    surface: Surface, observation: Observation, starts: Sequence[RefineStart]
) -> list[RefinedPose]:
    """Fits K poses to one frame's silhouettes, each from its own start; see `refine`.

    They take their steps together, so that the kernels can work on all of them in parallel. One
    alone is refined by the calling thread: its steps are too short to wake others.
    """
    with one_thread() if len(starts) == 1 else nullcontext():
        return _refined_together(surface, observation, starts)


def _refined_together(
    surface: Surface, observation: Observation, starts: Sequence[RefineStart]
) -> list[RefinedPose]:
    """As `refine_many`, with the threads that are set."""
    steps = np.array([len(start.settings.reaches_m) for start in starts])
    order = np.argsort(-steps, kind="stable")  # those that take most steps come first
    starts, steps = [starts[k] for k in order], steps[order]
    model = surface.model
    poses = PoseArrays.from_poses([start.pose for start in starts])
    priors = pose_arrays(
        poses,
        [start.prior for start in starts],
        [start.settings.usual for start in starts],
        model.tree,
    )
    landmark_priors = landmark_arrays(
        [start.landmark_prior for start in starts], len(model.landmarks_m)
    )
    size = 6 + model.dof_count
    matrices = np.tile(np.eye(size), (len(starts), 1, 1))
    for step in range(int(steps.max(initial=0))):
        count = int((steps > step).sum())
        reach = np.array([start.settings.reaches_m[step] for start in starts[:count]])
        moving = poses.first(count)
        posed = surface.posed_many(moving, bool(reach.any()))
        matrices[:count], gradient = 0.0, np.zeros((count, size))
        if reach.any():
            weights = contour_weights([start.settings for start in starts[:count]], reach)
            add_silhouettes(surface, posed, observation, reach, weights, matrices[:count], gradient)
        add_pose_priors(matrices[:count], gradient, moving, model, priors)
        add_landmark_priors(matrices[:count], gradient, model, posed, landmark_priors)
        change = solve_steps(matrices[:count], gradient, moving.angles_rad, model)
        move_poses(change, model.tree.dof_limits_rad, *moving.arrays)
    refined = [RefinedPose(*one) for one in zip(poses.poses(), matrices, strict=True)]
    return [refined[k] for k in np.argsort(order)]


def free_unknowns(model: BodyModel) -> np.ndarray:
    """Indices of the unknowns of a step that are not held fixed, in the order of `Pose.moved`."""
    return np.concatenate([np.arange(6), 6 + np.flatnonzero(~model.tree.dof_fixed)])


def step_bounds(angles_rad: np.ndarray, model: BodyModel) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest steps (K, 6 + D) of poses with angles (K, D): trust region and limits."""
    trust = REFINEMENT.trust_rad
    low = np.full((len(angles_rad), 6 + angles_rad.shape[1]), -trust)
    low[:, :3] = -REFINEMENT.trust_m
    high = -low
    # An angle that starts beyond its limit may return by as much as the trust region allows.
    below, above = (limit - angles_rad for limit in model.tree.dof_limits_rad.T)
    low[:, 6:] = np.minimum(np.maximum(below, -trust), 0.0)
    high[:, 6:] = np.maximum(np.minimum(above, trust), 0.0)
    return low, high


def solve_steps(
    matrix: np.ndarray, gradient: np.ndarray, angles_rad: np.ndarray, model: BodyModel
) -> np.ndarray:
    r"""Steps of K poses that minimise the normal equations' quadratic in joint limits and a trust
    region.

    .. math:: \min_\delta \tfrac{1}{2} \delta^T H \delta + g^T \delta
        \quad \text{subject to} \quad l \le \delta \le u

    solved by fixing unknowns at the bounds that they violate, until none does. Clipping the
    unbounded step instead would separate rotations that compensate each other, such as those of
    pelvis and lumbar spine.

    Args:
        matrix: (K, n, n) float64, H, positive definite on the free unknowns; n = 6 + D.
        gradient: (K, n) float64, g.
        angles_rad: (K, D) float64, current joint angles.

    Returns:
        (K, n) float64; zero for what is held fixed.
    """
    steps = np.empty_like(gradient)
    low, high = step_bounds(angles_rad, model)
    bounded_steps(matrix, gradient, free_unknowns(model), low, high, steps)
    return steps


def contour_weights(settings: Sequence[RefineSettings], reach_m: np.ndarray) -> np.ndarray:
    """Weights (K, 3) of the residuals of K poses, as `add_silhouette_terms` takes them; 0 where the
    reach (K,) is 0.
    """
    weights = np.zeros((len(settings), 3))
    for row, setting, reach in zip(weights, settings, reach_m, strict=True):
        if reach:
            largest = setting.independence / setting.contour_m**2
            scale = max(0.5 * reach, 2 * setting.contour_m)
            row[:] = scale, largest, REFINEMENT.outside * largest
    return weights


def add_silhouettes(
    surface: Surface,
    posed: PosedSurface,
    observation: Observation,
    reach_m: np.ndarray,
    weights: np.ndarray,
    matrix: np.ndarray,
    gradient: np.ndarray,
) -> None:
    r"""Adds the residuals of K poses to their normal equations, in place; see `residuals`.

    A residual along :math:`n` of a point that part p moves with weight :math:`\omega_p` to
    :math:`x_p` has the wrenches :math:`h_p = \omega_p (n,\, x_p \times n)`, and unknown d, whose
    twist is :math:`s_d`, changes it by :math:`s_d \cdot \sum_{p \in D(d)} h_p`, with the parts
    :math:`D(d)` that it moves. So

    .. math:: (J^T W J)_{de} = s_d^T \Bigl(\sum_{p \in D(d)} \sum_{q \in D(e)} M_{pq}\Bigr) s_e,
        \qquad M_{pq} = \sum_i w_i h_{ip} h_{iq}^T

    Args:
        reach_m: (K,), largest accepted distance between contour and surface.
        weights: (K, 3), see `contour_weights`.
        matrix: (K, 6 + D, 6 + D) float64.
        gradient: (K, 6 + D) float64.
    """
    matched, gap, distance, toward = _correspondences(posed, observation, reach_m)
    add_silhouette_terms(
        (matched, gap, observation.normal),
        (distance, toward),
        weights,
        REFINEMENT.outside_m,
        surface.arrays,
        posed.placed,
        matrix,
        gradient,
    )


def _correspondences(
    posed: PosedSurface, observation: Observation, reach_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What `match_contours` and `measure_outside` find: matched and gap (K, N), distances outside
    (K, C, V) and their directions (K, C, V, 3).
    """
    views, (count, points) = observation.views, posed.points.shape[:2]
    shape = count, len(observation.camera)
    matched, gap = np.empty(shape, np.int64), np.empty(shape)
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
    distance, toward = [], []
    for c, outside in enumerate(observation.outside_px):
        distance.append(np.empty((count, points)))
        toward.append(np.empty((count, points, 3)))
        measure_outside(
            posed.points,
            views.intrinsics[c],
            views.rotation[c],
            views.translation_m[c],
            outside,
            distance[c],
            toward[c],
        )
    return matched, gap, np.stack(distance, axis=1), np.stack(toward, axis=1)


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
        reach_m: largest accepted distance between contour and surface.

    Source: weights of Geman and McClure (1987); correspondences own.
    """
    reach = np.array([reach_m])
    scale, base, base_outside = contour_weights([settings], reach)[0]
    correspondences = _correspondences(posed[None], observation, reach)
    matched, gap, distance, toward = (one[0] for one in correspondences)
    hits = np.flatnonzero(matched >= 0)
    index, direction, gaps = [matched[hits]], [observation.normal[hits]], [gap[hits]]
    weight = [base / (1 + (gap[hits] / scale) ** 2) ** 2]
    for far, along in zip(distance, toward, strict=True):
        out = np.flatnonzero(far > 0)
        index.append(out)
        direction.append(along[out])
        gaps.append(far[out])
        weight.append(base_outside / (1 + (far[out] / REFINEMENT.outside_m) ** 2) ** 2)
    return Residuals(
        np.concatenate(index),
        np.concatenate(direction),
        np.concatenate(gaps),
        np.concatenate(weight),
    )


PosePriors = tuple[PoseArrays, np.ndarray, np.ndarray]
"""Priors of K poses as arrays for kernels: the means; inverse variances (K, 6 + D) in the order of
`Pose.moved`, 0 where nothing is known; and those of the resting stance (K, D), 1/rad²."""


def pose_arrays(
    poses: PoseArrays,
    priors: Sequence[PosePrior | None],
    usual: Sequence[float],
    tree: KinematicTree = HUMAN,
) -> PosePriors:
    """Copies priors.

    Args:
        poses: K poses, of which the shape counts alone.
        priors: K priors, None where nothing but the resting stance is expected.
        usual: K weights of the resting stance.
    """
    means = PoseArrays(*(one.copy() for one in poses.arrays))
    precision = np.zeros((len(poses), 6 + poses.angles_rad.shape[1]))
    for k, prior in enumerate(priors):
        if prior is not None:
            mean = prior.pose
            means.root_m[k], means.root_rotation[k] = mean.root_m, mean.root_rotation
            means.angles_rad[k], precision[k] = mean.angles_rad, 1 / prior.sigma**2
    return means, precision, np.asarray(usual, float)[:, None] / usual_rad(tree) ** 2


def add_pose_priors(
    matrix: np.ndarray,
    gradient: np.ndarray,
    poses: PoseArrays,
    model: BodyModel,
    priors: PosePriors,
) -> None:
    """Adds the priors to the normal equations of K poses, in place: resting stance, given prior.

    Args:
        matrix: (K, 6 + D, 6 + D) float64.
        gradient: (K, 6 + D) float64.
        priors: of K poses or more, of which the first ones count.
    """
    count, (means, precision, usual_precision) = len(poses), priors
    add_pose_terms(
        poses.arrays,
        means.first(count).arrays,
        precision[:count],
        (usual_precision[:count], relaxed_rad(model.tree)),
        matrix,
        gradient,
    )
