"""Cost of a step from pose to pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.dynamics import ROOT_STEP_M, ROOT_STEP_RAD
from silhouette_core.motion.pose import PoseArrays


def transition_cost(
    before: PoseArrays,
    after: PoseArrays,
    occluded: NDArray[np.bool_],
    sigma_rad: NDArray[np.float64],
    steps: float,
) -> NDArray[np.float64]:
    """Negative logarithm of the transition probability between all poses of two frames.

    The random walk of :eq:`okada-4` and :eq:`okada-5` over joint angles, orientation and position;
    the source pose decides which parts are occluded. Beyond the paper, a spacing of 3 degrees and
    5 cm, of poses that refinement does not tell apart, is added to the variances.
    The normaliser of the Gaussian counts, since :eq:`okada-5` makes it differ between sources.

    Args:
        before: M poses of a frame.
        after: M' poses of the next frame.
        occluded: (M, D), whether the part that an angle turns is occluded, eq. (3).
        sigma_rad: (D,), deviations of the joint angles within 1 / `dynamics.FPS`.
        steps: time between the frames in units of 1 / `dynamics.FPS`.

    Returns:
        (M, M') float64, nats, up to a constant that is the same for all.

    Source: Okada and Stenger, eq. (4), (5); spacing is ours.
    """
    spacing_rad = np.radians(3.0)
    magnified = np.where(occluded, MOTION_MODEL.magnification, 1.0)  # eq. (5)
    sigma = np.sqrt((sigma_rad * steps * magnified) ** 2 + spacing_rad**2)
    scaled = before.angles_rad / sigma
    # Eq. (4): |a - b|^2 with a's own scale, expanded so that no (M, M', D) array is made.
    precision = 1.0 / sigma**2
    cost = (
        (scaled**2).sum(1)[:, None]
        - 2 * (scaled / sigma) @ after.angles_rad.T
        + precision @ (after.angles_rad**2).T
    )
    # The angle between rotations from the trace of their quotient.
    trace = np.einsum("aij,bij->ab", before.root_rotation, after.root_rotation)
    turn = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
    cost += turn**2 / ((ROOT_STEP_RAD * steps) ** 2 + spacing_rad**2)
    gap = before.root_m[:, None] - after.root_m[None]
    cost += (gap**2).sum(-1) / ((ROOT_STEP_M * steps) ** 2 + 0.05**2)
    # A wider Gaussian is lower: without its normaliser every occluded part would be a bonus.
    usual = np.sqrt((sigma_rad * steps) ** 2 + spacing_rad**2)
    widened = np.log(sigma / usual).sum(1)[:, None]
    return 0.5 * np.maximum(cost, 0.0) + widened


def yaw_rotations(heading_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (N, 3, 3) about the vertical by (N,) headings."""
    return Rotation.from_rotvec(np.asarray(heading_rad)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
