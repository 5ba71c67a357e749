"""Bodies placed so that their joints are where priors expect them: inverse kinematics."""

from collections.abc import Sequence

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface

_PLACING = RefineSettings(reaches_m=(0,) * 7)  # no contour


def place_bodies(
    surface: Surface,
    observation: Observation,
    priors: Sequence[LandmarkPrior],
) -> list[Pose]:
    """Poses whose joints are where priors expect them, from relaxed ones turned as they expect.

    Args:
        observation: the frame; its contour is not used.
        priors: of the joints, one for each pose.
    """
    given = [RefineStart(_upright(prior), _PLACING, None, prior) for prior in priors]
    return [one.pose for one in refine_many(surface, observation, given)]


def _upright(prior: LandmarkPrior) -> Pose:
    """Relaxed pose with pelvis and trunk where the prior expects them."""
    joints = prior.landmarks_m
    name = LANDMARK_NAMES.index
    across = (joints[name("left_hip")] - joints[name("right_hip")]) + (
        joints[name("left_shoulder")] - joints[name("right_shoulder")]
    )
    up = joints[name("neck")] - joints[name("pelvis")]
    up = up / np.linalg.norm(up)
    right = across - up * (across @ up)
    right /= max(float(np.linalg.norm(right)), 1e-9)
    return Pose(prior.pelvis_m, np.stack([right, np.cross(up, right), up], 1), RELAXED_RAD.copy())
