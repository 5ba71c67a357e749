"""How uncertain the silhouettes leave the joints of a refined pose."""

from __future__ import annotations

import numpy as np

from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.landmark_prior import landmark_jacobian
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefineSettings, free_unknowns, refine
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

_LAST = RefineSettings(reaches_m=REFINEMENT.body_reaches_m[-1:])


def landmark_sigma_m(surface: Surface, observation: Observation, pose: Pose) -> np.ndarray:
    r"""Standard deviations (L,) float64 of the landmarks' positions, m.

    With the normal equations' matrix :math:`A` at the pose and the landmarks' derivatives
    :math:`J_l` (3, 6 + D) by its unknowns,

    .. math:: \sigma_l = \sqrt{\operatorname{tr} (J_l A^{-1} J_l^T)}

    It tells which joints the outlines hold and which they leave free. What all outlines get wrong
    together, as by wide clothes, is not in it.

    Args:
        pose: refined on it.

    Source: textbook (Laplace's approximation of the posterior).
    """
    model, free = surface.model, free_unknowns(surface.model)
    matrix = refine(surface, observation, pose, settings=_LAST).normal_matrix[np.ix_(free, free)]
    posed = surface.posed(pose)
    rows = landmark_jacobian(model, posed)[:, :, free]
    covariance = np.linalg.inv(matrix + 1e-6 * np.eye(len(free)))
    return np.sqrt(np.einsum("lia,ab,lib->l", rows, covariance, rows))
