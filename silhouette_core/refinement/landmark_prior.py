"""Prior of the joints' positions for the refinement: as a proposal of poses gives it, and of joints
that somebody set by hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.checks import FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import joint_centres
from silhouette_core.motion.pose import JointTarget
from silhouette_core.refinement.kernels.refine import add_normal_equations
from silhouette_core.refinement.kernels.steps import add_landmark_terms
from silhouette_core.refinement.surface import PosedSurface, point_jacobian
from silhouette_core.tuning import REFINEMENT, TRAJECTORY


@dataclass(frozen=True, eq=False)
class LandmarkPrior:
    """Prior of the 15 landmarks: Student's t about each, relative to the pelvis."""

    relative_m: FloatArray  #: (15, 3) float64, means relative to the pelvis, in the world.
    precision: FloatArray
    """(15, 3, 3) float64, inverse squared scales, 1/m²; the pelvis's own is not used."""
    pelvis_m: FloatArray  #: (3,) float64, mean of the pelvis, in the world.
    pelvis_precision: FloatArray  #: (3, 3) float64, its inverse covariance, 1/m².

    @property
    def landmarks_m(self) -> FloatArray:
        """Means (15, 3) of all landmarks in the world."""
        return self.pelvis_m + self.relative_m


def landmark_arrays(
    priors: Sequence[LandmarkPrior | None], landmarks: int = len(LANDMARK_NAMES)
) -> tuple[np.ndarray, ...]:
    """Priors of K poses, None where a pose has none, as `add_landmark_terms` takes them: whether
    there is one (K,) bool, and what `LandmarkPrior` has, with a first axis of K, float64.

    Args:
        landmarks: L, their number.
    """
    shapes = (landmarks, 3), (landmarks, 3, 3), (3,), (3, 3)
    arrays = tuple(np.zeros((len(priors), *shape)) for shape in shapes)
    for k, prior in enumerate(priors):
        if prior is not None:
            values = prior.relative_m, prior.precision, prior.pelvis_m, prior.pelvis_precision
            for array, value in zip(arrays, values, strict=True):
                array[k] = value
    return np.array([prior is not None for prior in priors]), *arrays


def landmark_jacobian(
    model: BodyModel, posed: PosedSurface, rest_m: FloatArray | None = None
) -> FloatArray:
    """Derivatives (L, 3, 6 + D) of the landmarks by a step of `Pose.moved`, or of other points
    (L, 3), as they are at rest, of the same parts.
    """
    count = len(model.landmarks_m)
    skin_parts, skin_weights = np.zeros((count, 4), np.int32), np.zeros((count, 4))
    skin_parts[:, 0], skin_weights[:, 0] = model.tree.landmark_part, 1.0
    points_m = model.landmarks_m if rest_m is None else rest_m
    rest = points_m, model.joints_m, skin_parts, skin_weights
    index, direction = np.repeat(np.arange(count), 3), np.tile(np.eye(3), (count, 1))
    rows = point_jacobian(model, posed, rest, index, direction)
    return rows.reshape(count, 3, -1)


def target_gaps(
    model: BodyModel, centres_m: FloatArray, targets: Sequence[JointTarget]
) -> tuple[list[int], FloatArray]:
    """Joints of n targets, and how far (K, n, 3) centres of K poses (K, L, 3) are from them."""
    index = [model.tree.landmark_names.index(one.joint) for one in targets]
    places = np.array([one.place_m for one in targets]).reshape(-1, 3)
    return index, centres_m[:, index] - places


def target_costs(
    model: BodyModel, centres_m: FloatArray, targets: Sequence[JointTarget]
) -> FloatArray:
    """Costs (K,), nats, of poses with joint centres (K, L, 3) that are not where they were set."""
    _, gaps = target_gaps(model, centres_m, targets)
    return 0.5 * (gaps**2).sum(axis=(1, 2)) / TRAJECTORY.target_m**2


def add_targets(
    matrix: FloatArray,
    gradient: FloatArray,
    model: BodyModel,
    posed: PosedSurface,
    targets: Sequence[JointTarget],
) -> None:
    """Adds what `target_costs` counts to the normal equations (n, n) and (n,) of a pose."""
    joints = joint_centres(model, posed.part_rotation[None], posed.part_origin[None])
    index, gaps = target_gaps(model, joints, targets)
    jacobian = landmark_jacobian(model, posed, model.joint_centres_m)
    rows = jacobian[index].reshape(-1, len(gradient))
    weight = np.full(len(rows), TRAJECTORY.target_m**-2)
    add_normal_equations(rows, weight, gaps.ravel(), matrix, gradient)


def add_landmark_priors(
    matrix: FloatArray,
    gradient: FloatArray,
    model: BodyModel,
    posed: PosedSurface,
    priors: tuple[np.ndarray, ...],
) -> None:
    r"""Adds priors to the normal equations of K poses, in place.

    With the landmarks' deviations :math:`e_l` from their means and the matrices :math:`P_l` of
    inverse squared scales, Student's t with :math:`\nu` degrees of freedom in three dimensions is
    a Gaussian of weight

    .. math:: w_l = \frac{\nu + 3}{\nu + e_l^T P_l e_l}

    Args:
        matrix: (K, 6 + D, 6 + D) float64.
        gradient: (K, 6 + D) float64.
        priors: `landmark_arrays` of K poses or more, of which the first ones count.

    Source: iteratively reweighted least squares for Student's t (Lange, Little and Taylor 1989).
    """
    first = tuple(array[: len(matrix)] for array in priors)
    if not first[0].any():
        return
    local = model.landmarks_m - model.joints_m[model.tree.landmark_part]
    add_landmark_terms(
        (model.tree.landmark_part, local, model.tree.descends, model.tree.dof_part),
        posed.placed,
        first,
        REFINEMENT.student_freedom,
        matrix,
        gradient,
    )
