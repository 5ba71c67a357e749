"""Cost of a step from pose to pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.dynamics import ROOT_STEP_M, elapsed_steps


@dataclass(frozen=True, eq=False)
class PoseCandidates:
    """Candidate poses of one frame: M poses with D joint angles.

    Attributes:
        root_m: (M, 3) float64, position of the pelvis joint in the world, m.
        root_rotation: (M, 3, 3) float64, world from body.
        angles_rad: (M, D) float64, joint angles.
        occluded: (M, D) bool, whether the part that an angle turns is occluded, eq. (3).
    """

    root_m: NDArray[np.float64]
    root_rotation: NDArray[np.float64]
    angles_rad: NDArray[np.float64]
    occluded: NDArray[np.bool_]
    time_s: float


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Standard deviations of a body's step within 1 / `dynamics.FPS`. D joint angles.

    Attributes:
        sigma_rad: (D,) float64, of the joint angles.
        root_rad: of the orientation of the whole body.
        root_m: of its position, along each axis.
        restart_cost: largest cost of a step, in nats; beyond it the trajectory restarts.
        spacing_rad: distance of neighbouring poses in the library, the resolution of any motion.
    """

    sigma_rad: NDArray[np.float64]
    root_rad: float = 0.10
    root_m: float = ROOT_STEP_M
    restart_cost: float = 40.0
    spacing_rad: float = 0.10


def transition_cost(
    before: PoseCandidates, after: PoseCandidates, noise: ProcessNoise
) -> NDArray[np.float64]:
    """Negative logarithm of the transition probability between all candidates of two frames.

    The random walk of :eq:`okada-4` and :eq:`okada-5` over joint angles, orientation and position;
    the source pose decides which parts are occluded. Beyond the paper, the spacing of the library
    is added to the variances, and the cost is bounded.
    The normaliser of the Gaussian counts, since :eq:`okada-5` makes it differ between sources.

    Args:
        before: M candidates of a frame.
        after: M' candidates of the next frame.

    Returns:
        (M, M') float64, nats, up to a constant that is the same for all.

    Source: Okada and Stenger, eq. (4), (5); spacing and bound are ours.
    """
    steps = elapsed_steps(before.time_s, after.time_s)
    magnified = np.where(before.occluded, MOTION_MODEL.magnification, 1.0)  # eq. (5)
    sigma = np.sqrt((noise.sigma_rad * steps * magnified) ** 2 + noise.spacing_rad**2)
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
    cost += turn**2 / ((noise.root_rad * steps) ** 2 + noise.spacing_rad**2)
    gap = before.root_m[:, None] - after.root_m[None]
    cost += (gap**2).sum(-1) / ((noise.root_m * steps) ** 2 + 0.05**2)
    # A wider Gaussian is lower: without its normaliser every occluded part would be a bonus.
    usual = np.sqrt((noise.sigma_rad * steps) ** 2 + noise.spacing_rad**2)
    widened = np.log(sigma / usual).sum(1)[:, None]
    return np.minimum(0.5 * np.maximum(cost, 0.0) + widened, noise.restart_cost)


def yaw_rotations(heading_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (N, 3, 3) about the vertical by (N,) headings."""
    return Rotation.from_rotvec(np.asarray(heading_rad)[:, None] * [0.0, 0.0, 1.0]).as_matrix()
