"""Poses that what was learned of silhouettes proposes, who proposes them, and bodies placed so that
their joints are where they are expected: inverse kinematics.

A proposer is a class without constructor arguments, registered under the entry point group
`silhouette_core.pose_proposers`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.entry_points import load_registered
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import rounded
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

GROUP = "silhouette_core.pose_proposers"


@dataclass(frozen=True, eq=False)
class ProposedPoses:
    """M probable poses of one frame."""

    probability: FloatArray  #: (M,) float64, summing to 1.
    priors: list[LandmarkPrior]  #: M priors of the joints' positions.

    @property
    def likeliest(self) -> FloatArray:
        """Joints (15, 3) of the likeliest pose in the world."""
        return self.probable(1)[0].landmarks_m

    def probable(self, count: int) -> list[LandmarkPrior]:
        """The most probable poses, likeliest first."""
        order = np.argsort(rounded(-self.probability), kind="stable")[:count]
        return [self.priors[pose] for pose in order]

    def nearest(self, landmarks_m: FloatArray) -> LandmarkPrior:
        """The proposed pose nearest to a pose's joints (15, 3), relative to the pelvis."""
        relative = landmarks_m - landmarks_m[0]
        gaps = [np.linalg.norm(prior.relative_m - relative) for prior in self.priors]
        return self.priors[int(np.argmin(rounded(gaps)))]

    def cost(self, landmarks_m: FloatArray) -> FloatArray:
        """Cost (K,), nats, of poses: the negative logarithm of the mixture at their joints.

        Args:
            landmarks_m: (K, 15, 3), joints in the world.
        """
        relative = landmarks_m - landmarks_m[:, :1]
        logs, freedom = np.empty((len(relative), len(self.priors))), REFINEMENT.student_freedom
        for pose, prior in enumerate(self.priors):
            error = (relative - prior.relative_m)[:, 1:]
            square = np.einsum("kli,lij,klj->kl", error, prior.precision[1:], error)
            cost = 0.5 * (freedom + 3) * np.log1p(square / freedom).sum(axis=1)
            weight = np.log(max(self.probability[pose], 1e-6))
            logs[:, pose] = weight - REFINEMENT.proposed * cost
        most = logs.max(axis=1, keepdims=True)
        return -(most[:, 0] + np.log(np.exp(logs - most).sum(axis=1)))

    def at(self, pelvis_m: FloatArray, scale: float) -> "ProposedPoses":
        """The same poses of a body larger by a factor, with the pelvis (3,) elsewhere."""
        priors = [
            replace(
                prior,
                relative_m=scale * prior.relative_m,
                precision=prior.precision / scale**2,
                pelvis_m=pelvis_m,
            )
            for prior in self.priors
        ]
        return replace(self, priors=priors)


@runtime_checkable
class PoseProposer(Protocol):
    """Proposes poses of a person by silhouettes of one camera; called from several threads."""

    def propose(
        self, camera: Camera, stature_m: float, frames: Iterable[tuple[float, BoolArray]]
    ) -> list[ProposedPoses | None]:
        """Poses in each of consecutive frames, at the distance of somebody of a stature; None: it
        shows nobody.

        Args:
            camera: pinhole camera without distortion, in a world with z up.
            frames: time, s, and silhouette (h, w) bool of each.
        """
        ...


def load_pose_proposer(name: str = "learned") -> PoseProposer:
    """The proposer that is registered under a name. Raises InputError where none is."""
    return load_registered(GROUP, "pose proposer", PoseProposer, name)


_PLACING = RefineSettings(reaches_m=(0,) * 7)  # no contour


def place_bodies(
    surface: Surface, observation: Observation, priors: Sequence[LandmarkPrior]
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
