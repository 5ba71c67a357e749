"""Search for the pose hypotheses of a frame.

What the frame's proposal begins with, and the predictions from the hypotheses of the previous
frame, are refined on the silhouette; limbs of the best ones are then put where they leave the
silhouette uncovered. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.tracking.beam import Beam, select_different
from silhouette_core.monocular.tracking.frame_costs import TrackerSettings
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, ObservedFrame
from silhouette_core.monocular.tracking.uncovered_limbs import reach_uncovered
from silhouette_core.motion.dynamics import elapsed_steps, pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

FROM_PREDICTION = RefineSettings(reaches_m=REFINEMENT.near_reaches_m[1:-1])
"""Refinement of a pose that is nearly right."""

FoundPoses = tuple[list[Pose], list[LandmarkPrior | None]]
"""Poses, and the prior of the joints' positions that each was refined with."""


def find_hypotheses(
    surface: Surface,
    observed: ObservedFrame,
    proposal: FrameProposal,
    past: tuple[Beam, list[Pose]] | None,
    settings: TrackerSettings,
) -> FoundPoses:
    """Hypotheses of a frame.

    Args:
        past: hypotheses of the previous frame, and where each is expected in this one.
    """
    starts = proposal.starts(surface, observed.contour)
    if past is not None:
        previous, predicted = past
        steps = elapsed_steps(previous.time_s, observed.time_s)
        sigma = pose_step_sigma(surface.model.tree) * steps
        order = np.argsort(previous.cost, kind="stable")
        carried = [
            predicted[k]
            for k in select_different(
                previous.joints, order, settings.carried, settings.different_m
            )
        ]
        starts += [
            RefineStart(pose, FROM_PREDICTION, PosePrior(pose, sigma), proposal.nearest(own))
            for pose, own in zip(carried, joints_of(surface.model, carried), strict=True)
        ]
    refined = refine_many(surface, observed.contour, starts)
    found = [one.pose for one in refined], [start.landmark_prior for start in starts]
    return _reaching(surface, observed, found, proposal, settings)


def joints_of(model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.float64]:
    """Joints (K, L, 3) of poses in the world."""
    if not poses:
        return np.empty((0, len(model.landmarks_m), 3))
    return landmarks(model, *place(model, *PoseArrays.from_poses(poses).arrays))


def _reaching(
    surface: Surface,
    observed: ObservedFrame,
    found: FoundPoses,
    proposal: FrameProposal,
    settings: TrackerSettings,
) -> FoundPoses:
    """Adds poses whose limbs reach where the best ones leave the silhouette uncovered."""
    poses, priors = found
    tried: list[int] = []
    for _ in range(settings.reaching):
        distance = observed.weights.distances(surface.model, poses)
        cost = 0.5 * (distance / settings.costs.silhouette) ** 2
        cost += proposal.cost(joints_of(surface.model, poses))
        best = np.argsort(cost, kind="stable")[: settings.reaching]
        # Within its sigma, nothing is missing.
        most = settings.costs.silhouette
        best = [int(k) for k in best if distance[k] > most and k not in tried]
        known = [prior for prior in (priors[k] for k in best) if prior is not None]
        more, own = reach_uncovered(surface, observed, [poses[k] for k in best], known)
        if not more:
            break
        poses, priors, tried = [*poses, *more], [*priors, *own], [*tried, *best]
    return poses, priors
