"""Proportions of one person's body, estimated from several frames jointly.

Two people of one stature differ by several per cent in the length of every limb, which silhouettes
of a few different poses show. Shape and poses are refined together; the poses are eliminated from
the normal equations (Schur complement), so that only the shape deviations remain to be solved for.
Beyond both papers, which choose among ready-made bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.kernels.refine import add_normal_equations
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import (
    RefineSettings,
    add_pose_priors,
    bounded_step,
    refine,
    residuals,
)
from silhouette_core.refinement.surface import Surface

_REACHES_M = (0.12, 0.10, 0.08, 0.07, 0.06, 0.05, 0.05, 0.05)
_LARGEST = 3.0  # largest deviation of a person's shape, in standard deviations
_SETTLE = RefineSettings(reaches_m=(0.08, 0.06, 0.05))


@dataclass(frozen=True)
class Stature:
    """A person's height.

    Attributes:
        metres: the height, m.
        sigma_m: its standard deviation, m.
    """

    metres: float
    sigma_m: float


def adapt_shape(
    surface: Surface,
    observations: list[Observation],
    poses: list[Pose],
    stature: Stature,
    expected: np.ndarray,
) -> tuple[Surface, list[Pose]]:
    """Adapts a body's proportions to the silhouettes of several frames.

    Args:
        surface: of the initial body.
        observations: F frames, of different poses.
        poses: F poses, right to within about 0.1 m.
        stature: the person's height.
        expected: (K,) mean of the prior of the shape.

    Returns:
        The surface of the adapted body, and the F poses refined on it.
    """
    model = surface.model
    settings = RefineSettings()
    free = np.concatenate([np.arange(6), 6 + np.flatnonzero(~model.dof_fixed)])
    for reach in _REACHES_M:
        matrix = np.diag(1 / SHAPE_SIGMA**2)
        gradient = (surface.model.shape - expected) / SHAPE_SIGMA**2
        _add_stature(matrix, gradient, surface.model, stature)
        systems = []
        for observation, pose in zip(observations, poses, strict=True):
            system = _FrameSystem(surface, observation, pose, reach, settings)
            systems.append(system)
            eliminated = np.linalg.solve(
                system.pose[np.ix_(free, free)] + 1e-6 * np.eye(len(free)), system.cross[free]
            )
            matrix += system.shape - system.cross[free].T @ eliminated
            gradient += system.shape_gradient - eliminated.T @ system.pose_gradient[free]
        step = -np.linalg.solve(matrix, gradient)
        shape = np.clip(
            surface.model.shape + step,
            expected - _LARGEST * SHAPE_SIGMA,
            expected + _LARGEST * SHAPE_SIGMA,
        )
        change = shape - surface.model.shape
        steps = [
            bounded_step(
                system.pose,
                system.pose_gradient + system.cross @ change,
                free,
                pose.angles_rad,
                model,
            )
            for system, pose in zip(systems, poses, strict=True)
        ]
        poses = [pose.moved(step).clipped() for pose, step in zip(poses, steps, strict=True)]
        surface = surface.reshaped(shape)
    poses = [
        refine(surface, observation, pose, settings=_SETTLE).pose
        for observation, pose in zip(observations, poses, strict=True)
    ]
    return surface, poses


def stature_of(model: BodyModel) -> float:
    """Height of the body at rest, from soles to vertex, metres."""
    return float(
        model.landmarks_m[LANDMARK_NAMES.index("head_top"), 2] - model.vertices_m[:, 2].min()
    )


class _FrameSystem:
    """One frame's normal equations in pose and shape."""

    def __init__(
        self,
        surface: Surface,
        observation: Observation,
        pose: Pose,
        reach: float,
        settings: RefineSettings,
    ):
        """Linearises the residuals of one frame; `reach` in metres."""
        posed = surface.posed(pose)
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
        n = 6 + surface.model.dof_count
        self.pose, self.cross, self.shape = matrix[:n, :n].copy(), matrix[:n, n:], matrix[n:, n:]
        self.pose_gradient, self.shape_gradient = gradient[:n].copy(), gradient[n:]
        add_pose_priors(self.pose, self.pose_gradient, pose, surface.model, None, settings.usual)


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
