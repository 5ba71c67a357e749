"""Costs of the steps from frame to frame, and the cheapest past of each hypothesis by Viterbi's
recursion.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.dynamics import FPS, ROOT_STEP_M, ROOT_STEP_RAD, elapsed_steps, predict
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.ranking import rounded
from silhouette_core.tracking.beam import Beam
from silhouette_core.tuning import STEPS


@dataclass(frozen=True, eq=False)
class StepCosts:
    """What steps between the hypotheses of consecutive frames cost."""

    tree: KinematicTree  #: the body's.
    sigma_rad: FloatArray
    """(D,) float64, standard deviations of the joint angles within 1 / `FPS`."""
    magnification: float = 1.0
    """Factor on those of occluded parts, eq. (5); 1: the motion model DM1."""
    restart: float = STEPS.restart  #: largest cost of a step, nats; what costs more is no movement.

    def expected(self, previous: Beam, before_previous: Beam | None) -> list[Pose]:
        """Hypotheses of the previous frame moved on by one frame; restarted ones, and those of a
        first frame, have no velocity.
        """
        if before_previous is None:
            return previous.poses
        return [
            predict(
                pose, None if restarted else before_previous.poses[back], self.tree.dof_limits_rad
            )
            for pose, back, restarted in zip(
                previous.poses, previous.back, previous.restarted, strict=True
            )
        ]

    def between(
        self, previous: Beam, expected: list[Pose], beam: Beam
    ) -> tuple[FloatArray, BoolArray]:
        """Costs of the steps from the hypotheses of the previous frame.

        Returns:
            Costs (K, K') float64, nats, and whether each is that of a restart (K, K') bool.
        """
        # At a lower frame rate every step is cheaper; a restart has to remain dearer.
        restart = self.restart * max((beam.time_s - previous.time_s) * FPS, 1.0)
        occluded = previous.occluded[:, self.tree.dof_part] & ~self.tree.dof_fixed
        moving = transition_cost(
            PoseArrays.from_poses(expected),
            PoseArrays.from_poses(beam.poses),
            np.where(occluded, self.magnification, 1.0),
            self.sigma_rad,
            elapsed_steps(previous.time_s, beam.time_s),
        )
        moving = np.minimum(moving, restart)
        return moving, moving >= restart

    def continued(self, beam: Beam, previous: Beam, expected: list[Pose]) -> Beam:
        """Hypotheses with the cheapest past of each."""
        # Costs of a frame are those of 1 / FPS; a longer one counts for as much more.
        longer = float(np.clip((beam.time_s - previous.time_s) * FPS, 0.0, STEPS.longest_frame))
        alone = beam.alone * longer
        moving, restarted = self.between(previous, expected, beam)
        total = rounded(previous.cost[:, None] + moving)
        back = total.argmin(0)
        return replace(
            beam,
            alone=alone,
            cost=rounded(alone + total.min(0)),
            back=back,
            restarted=restarted[back, np.arange(len(back))],
        )


def transition_cost(
    before: PoseArrays, after: PoseArrays, widened: FloatArray, sigma_rad: FloatArray, steps: float
) -> FloatArray:
    """Negative logarithm of the transition probability between all poses of two frames.

    The random walk of :eq:`okada-4` and :eq:`okada-5` over joint angles, orientation and position;
    the source pose decides which parts are occluded. Beyond the paper, a spacing of poses that
    refinement does not tell apart is added to the variances.
    The normaliser of the Gaussian counts, since :eq:`okada-5` makes it differ between sources.

    Args:
        before: M poses of a frame.
        after: M' poses of the next frame.
        widened: (M, D) float64, factors on the deviations of the joint angles, by the source pose.
        sigma_rad: (D,), deviations of the joint angles within 1 / `dynamics.FPS`.
        steps: time between the frames in units of 1 / `dynamics.FPS`.

    Returns:
        (M, M') float64, nats, up to a constant that is the same for all.

    Source: Okada and Stenger, eq. (4), (5); spacing is ours.
    """
    spacing_rad = np.radians(STEPS.spacing_deg)
    sigma = np.sqrt((sigma_rad * steps * widened) ** 2 + spacing_rad**2)
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
    cost += (gap**2).sum(-1) / ((ROOT_STEP_M * steps) ** 2 + STEPS.spacing_m**2)
    # A wider Gaussian is lower: without its normaliser every occluded part would be a bonus.
    usual = np.sqrt((sigma_rad * steps) ** 2 + spacing_rad**2)
    return 0.5 * np.maximum(cost, 0.0) + np.log(sigma / usual).sum(1)[:, None]
