"""Proportions of one person's body, estimated from several frames jointly.

Two people of one stature differ by several per cent in the length of every limb, which silhouettes
of a few different poses show. Shape and poses are refined together; the poses are eliminated from
the normal equations (Schur complement), so that only the shape deviations remain to be solved for.
Beyond both papers, which choose among ready-made bodies.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.kernels.refine import add_normal_equations
from silhouette_core.refinement.kernels.steps import bounded_steps
from silhouette_core.refinement.landmark_prior import (
    LandmarkPrior,
    add_landmark_priors,
    landmark_arrays,
)
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import (
    RefineSettings,
    add_pose_priors,
    free_unknowns,
    pose_arrays,
    refine,
    residuals,
    solve_steps,
)
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT


@dataclass(frozen=True)
class Stature:
    """A person's height."""

    metres: float
    sigma_m: float


def adapt_shape(
    surface: Surface,
    observations: list[Observation],
    poses: list[Pose],
    stature: Stature,
    expected: np.ndarray,
    covariance: np.ndarray | None = None,
    settings: RefineSettings | None = None,
    landmark_priors: Sequence[LandmarkPrior] | None = None,
) -> tuple[Surface, list[Pose]]:
    """Adapts a body's proportions to the silhouettes of several frames.

    Args:
        observations: F frames, of different poses.
        poses: F poses, right to within about 0.1 m.
        expected: (K,) mean of the prior of the shape.
        covariance: (K, K) of that prior; None: `SHAPE_SIGMA`, independent.
        landmark_priors: priors of the joints' positions in the F frames, which decide the depth
            where there is one camera.

    Returns:
        The surface of the adapted body, and the F poses refined on it.
    """
    model = surface.model
    settings = settings or RefineSettings()
    covariance = np.diag(SHAPE_SIGMA**2) if covariance is None else covariance
    precision, largest = (
        np.linalg.inv(covariance),
        REFINEMENT.largest_shape * np.sqrt(np.diag(covariance)),
    )
    least = np.where(IS_CLOTHING, 0.0, expected - largest)
    every = np.arange(len(expected))
    priors = [None] * len(poses) if landmark_priors is None else landmark_priors
    for reach in REFINEMENT.body_reaches_m:
        matrix, gradient, systems = _shape_equations(
            surface, observations, poses, priors, reach, settings
        )
        matrix += precision
        gradient += precision @ (surface.model.shape - expected)
        _add_stature(matrix, gradient, surface.model, stature)
        shape = surface.model.shape
        low, high = least - shape, expected + largest - shape
        step = np.empty((1, len(gradient)))
        bounded_steps(matrix[None], gradient[None], every, low[None], high[None], step)
        change = step[0]
        matrices = np.array([system.pose for system in systems])
        gradients = np.array([one.pose_gradient + one.cross @ change for one in systems])
        angles = np.array([pose.angles_rad for pose in poses])
        steps = solve_steps(matrices, gradients, angles, model)
        poses = [pose.moved(step).clipped() for pose, step in zip(poses, steps, strict=True)]
        surface = surface.reshaped(shape + change)
    settle = replace(settings, reaches_m=REFINEMENT.body_reaches_m[2::2])
    poses = [
        refine(surface, observation, pose, settings=settle, landmark_prior=prior).pose
        for observation, pose, prior in zip(observations, poses, priors, strict=True)
    ]
    return surface, poses


def stature_of(model: BodyModel) -> float:
    """Height of the body at rest, from soles to vertex, metres."""
    return float(
        model.landmarks_m[LANDMARK_NAMES.index("head_top"), 2] - model.vertices_m[:, 2].min()
    )


def clothed_covariance() -> np.ndarray:
    """Prior covariance (K, K) of the shape of a clothed person of unknown build.

    Girths vary together from slim to heavy, and loose clothes add to all of them; the lengths of
    the limbs, which a single view confounds with depth, vary less than over all adults.
    """
    girth = np.array([axis.flesh and not axis.joints for axis in SHAPE_AXES]) & ~IS_CLOTHING
    sigma = SHAPE_SIGMA * np.where(girth, REFINEMENT.girth_sigma, REFINEMENT.length_sigma)
    sigma[IS_CLOTHING] = 1e-4  # one view does not tell clothes from girth
    return np.diag(sigma**2) + REFINEMENT.build_sigma**2 * np.outer(girth, girth)


def _shape_equations(
    surface: Surface,
    observations: Sequence[Observation],
    poses: Sequence[Pose],
    priors: Sequence[LandmarkPrior | None],
    reach: float,
    settings: RefineSettings,
) -> "tuple[np.ndarray, np.ndarray, list[_FrameSystem]]":
    r"""Normal equations (K, K) and (K,) of the shape, from which the poses are eliminated, and
    those of every frame.

    What is wrong with a silhouette or a body is wrong in others, too: of :math:`n` silhouettes
    whose residuals correlate by :math:`\rho`, each counts as

    .. math:: 1 / (1 + (n - 1) \rho)

    Source: the design effect of Kish, Survey Sampling (1965).
    """
    free, size = free_unknowns(surface.model), len(surface.model.shape)
    matrix, gradient, systems = np.zeros((size, size)), np.zeros(size), []
    for observation, pose, prior in zip(observations, poses, priors, strict=True):
        system = _FrameSystem(surface, observation, pose, reach, settings, prior)
        systems.append(system)
        eliminated = np.linalg.solve(
            system.pose[np.ix_(free, free)] + 1e-6 * np.eye(len(free)), system.cross[free]
        )
        matrix += system.shape - system.cross[free].T @ eliminated
        gradient += system.shape_gradient - eliminated.T @ system.pose_gradient[free]
    silhouettes = sum(len(observation.views.rig) for observation in observations)
    counted = 1 / (1 + (silhouettes - 1) * REFINEMENT.alike)
    return counted * matrix, counted * gradient, systems


class _FrameSystem:
    """One frame's normal equations in pose and shape."""

    def __init__(
        self,
        surface: Surface,
        observation: Observation,
        pose: Pose,
        reach: float,
        settings: RefineSettings,
        prior: LandmarkPrior | None,
    ):
        """Linearises the residuals of one frame; `reach` in metres."""
        poses, model = PoseArrays.from_poses([pose]), surface.model
        posed_many = surface.posed_many(poses)
        posed = posed_many[0]
        rows = residuals(surface, posed, observation, reach, settings)
        jacobian = np.concatenate(
            [
                surface.jacobian(posed, rows.index, rows.direction),
                surface.shape_jacobian(posed, rows.index, rows.direction),
            ],
            axis=1,
        )
        matrix, gradient = np.zeros((jacobian.shape[1],) * 2), np.zeros(jacobian.shape[1])
        add_normal_equations(jacobian, rows.weight, rows.gap_m, matrix, gradient)
        n = 6 + model.dof_count
        self.pose, self.cross, self.shape = matrix[:n, :n].copy(), matrix[:n, n:], matrix[n:, n:]
        self.pose_gradient, self.shape_gradient = gradient[:n].copy(), gradient[n:]
        matrix, gradient = self.pose[None], self.pose_gradient[None]
        add_pose_priors(
            matrix, gradient, poses, model, pose_arrays(poses, [None], [settings.usual])
        )
        add_landmark_priors(matrix, gradient, model, posed_many, landmark_arrays([prior]))


def _add_stature(
    matrix: np.ndarray, gradient: np.ndarray, model: BodyModel, stature: Stature
) -> None:
    """Adds the equation of the stature, linear in the shape."""
    sole = int(model.vertices_m[:, 2].argmin())
    row = (
        model.space.landmarks_change[:, LANDMARK_NAMES.index("head_top"), 2]
        - model.space.vertices_change[:, sole, 2]
    )
    matrix += np.outer(row, row) / stature.sigma_m**2
    gradient += row * (stature_of(model) - stature.metres) / stature.sigma_m**2
