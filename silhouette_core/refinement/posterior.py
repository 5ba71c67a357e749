"""What the normal equations of poses tell: how sure joints are, and where a root stands still."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.landmark_prior import landmark_jacobian
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefinedPose, RefineSettings, free_unknowns, refine
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


def still_root(
    surface: Surface,
    observations: Sequence[Observation],
    poses: Sequence[Pose],
    settings: RefineSettings,
) -> Pose:
    r"""Placement of a root that stands still, by several frames.

    Every frame is refined with its root free, and gives a root :math:`x_i` with the information
    :math:`S_i` that is left when its joint angles are free (the Schur complement of its normal
    equations). Together they give

    .. math:: x = \Bigl(\sum_i S_i\Bigr)^{-1} \sum_i S_i x_i

    Args:
        poses: of each, with about the same root.

    Returns:
        The root, with the joint angles of the first frame.

    Source: textbook (information-weighted mean).
    """
    refined = side_by_side(
        lambda k: refine(surface, observations[k], poses[k], None, settings), range(len(poses))
    )
    roots = np.array([one.pose.root_m for one in refined])
    near = np.linalg.norm(roots - np.median(roots, axis=0), axis=1) < REFINEMENT.same_root_m
    refined = [one for one, is_near in zip(refined, near, strict=True) if is_near] or refined
    middle = refined[0].pose
    steps = np.array([one.pose.minus(middle)[:6] for one in refined])
    weights = np.array([_root_information(one, surface.model) for one in refined])
    step = np.linalg.solve(weights.sum(0), np.einsum("kij,kj->i", weights, steps))
    turn = Rotation.from_rotvec(step[3:]).as_matrix()
    return Pose(middle.root_m + step[:3], turn @ middle.root_rotation, middle.angles_rad)


def _root_information(refined: RefinedPose, model: BodyModel) -> np.ndarray:
    free = free_unknowns(model)[6:]
    matrix = refined.normal_matrix
    across = matrix[:6, free]
    if not len(free):
        return matrix[:6, :6]
    return matrix[:6, :6] - across @ np.linalg.solve(matrix[np.ix_(free, free)], across.T)
