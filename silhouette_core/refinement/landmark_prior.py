"""Prior of the joints' positions, as a proposal of poses gives it, for the refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES, LANDMARK_PART
from silhouette_core.body.model import BodyModel
from silhouette_core.refinement.kernels.refine import fill_jacobian
from silhouette_core.refinement.surface import DESCENDS, PosedSurface

DEGREES_OF_FREEDOM = 4.0
"""Of Student's t distribution, which the proposal is trained with, too."""
_COUNT = len(LANDMARK_NAMES)
_SKIN_PARTS = np.zeros((_COUNT, 4), np.int32)
_SKIN_PARTS[:, 0] = LANDMARK_PART
_SKIN_WEIGHTS = np.zeros((_COUNT, 4))
_SKIN_WEIGHTS[:, 0] = 1.0
_POINTS = np.repeat(np.arange(_COUNT), 3)
_AXES = np.tile(np.eye(3), (_COUNT, 1))


@dataclass(frozen=True, eq=False)
class LandmarkPrior:
    """Prior of the 15 landmarks: Student's t about each, relative to the pelvis.

    Attributes:
        relative_m: (15, 3) float64, means relative to the pelvis, in the world.
        precision: (15, 3, 3) float64, inverse squared scales, 1/m²; the pelvis's own is not used.
        pelvis_m: (3,) float64, mean of the pelvis, in the world.
        pelvis_precision: (3, 3) float64, its inverse covariance, 1/m².
    """

    relative_m: NDArray[np.float64]
    precision: NDArray[np.float64]
    pelvis_m: NDArray[np.float64]
    pelvis_precision: NDArray[np.float64]

    @property
    def landmarks_m(self) -> NDArray[np.float64]:
        """Means (15, 3) of all landmarks in the world."""
        return self.pelvis_m + self.relative_m


def posed_landmarks(model: BodyModel, posed: PosedSurface) -> NDArray[np.float64]:
    """Landmarks (15, 3) of a posed body in the world, m."""
    local = model.landmarks_m - model.joints_m[LANDMARK_PART]
    turned = np.einsum("lij,lj->li", posed.part_rotation[LANDMARK_PART], local)
    return posed.part_origin[LANDMARK_PART] + turned


def landmark_jacobian(model: BodyModel, posed: PosedSurface) -> NDArray[np.float64]:
    """Derivatives (15, 3, 6 + D) of the landmarks by a step of `Pose.moved`."""
    rows = np.empty((3 * _COUNT, 6 + model.dof_count))
    fill_jacobian(
        _POINTS,
        _AXES,
        model.landmarks_m,
        model.joints_m,
        _SKIN_PARTS,
        _SKIN_WEIGHTS,
        posed.part_rotation,
        posed.part_origin,
        DESCENDS,
        model.dof_part,
        posed.world_axis,
        rows,
    )
    return rows.reshape(_COUNT, 3, -1)


def add_landmark_prior(
    matrix: NDArray[np.float64],
    gradient: NDArray[np.float64],
    model: BodyModel,
    posed: PosedSurface,
    prior: LandmarkPrior,
) -> None:
    r"""Adds the prior to the normal equations, in place.

    With the landmarks' deviations :math:`e_l` from their means and the matrices :math:`P_l` of
    inverse squared scales, Student's t with :math:`\nu` degrees of freedom in three dimensions is
    a Gaussian of weight

    .. math:: w_l = \frac{\nu + 3}{\nu + e_l^T P_l e_l}

    Args:
        matrix: (6 + D, 6 + D) float64.
        gradient: (6 + D,) float64.
        model: the body.
        posed: the same in its current pose.
        prior: the prior.

    Source: iteratively reweighted least squares for Student's t (Lange, Little and Taylor 1989).
    """
    jacobian, landmarks = landmark_jacobian(model, posed), posed_landmarks(model, posed)
    rows, relative = jacobian[1:] - jacobian[:1], landmarks[1:] - landmarks[:1]
    error, precision = relative - prior.relative_m[1:], prior.precision[1:]
    square = np.einsum("li,lij,lj->l", error, precision, error)
    weight = (DEGREES_OF_FREEDOM + 3) / (DEGREES_OF_FREEDOM + square)
    weighted = np.einsum("l,lij,ljk->lik", weight, precision, rows).reshape(-1, len(gradient))
    matrix += rows.reshape(-1, len(gradient)).T @ weighted
    gradient += weighted.T @ error.ravel()
    weighted = prior.pelvis_precision @ jacobian[0]
    matrix += jacobian[0].T @ weighted
    gradient += weighted.T @ (landmarks[0] - prior.pelvis_m)
