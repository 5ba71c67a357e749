"""Resampling of limbs over time, and refinement of the resulting trajectory on the contours.

Beyond paper A. A library's whole poses are coarse. Every recorded placement of each arm and leg is
scored by the same silhouette distance, and the cheapest trajectory through the best ones is chosen,
so that an occluded limb stays where the motion model predicts it. The refinement is continuous; its
prior is that trajectory, which decides where the silhouette does not, mostly in depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.limb_silhouette import LIMB_NAMES, LimbShape
from silhouette_core.monocular.making.thinning import thin_poses
from silhouette_core.monocular.tracking.motion_cost import PoseCandidates, ProcessNoise, viterbi
from silhouette_core.monocular.tracking.observed_frame import ObservedFrame
from silhouette_core.motion.dynamics import STEP_SIGMA_RAD, neighbour_middle
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.surface import Surface

_SPACING_RAD = np.radians(12.0)
_KEPT = 60  # placements of a limb per frame
_SIGMA = 0.04
_DEVIATION_RAD = np.radians(60.0)
_FIRST = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_POLISH = RefineSettings(reaches_m=(0.08, 0.06, 0.06))
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """A frame and its current pose.

    Attributes:
        pose: estimate to be improved.
        observed: what the frame shows.
    """

    pose: Pose
    observed: ObservedFrame


class LimbResampler:
    """Improves a trajectory of poses limb by limb.

    Args:
        model: the body.
        views: the camera.
        library_angles: (B, D) recorded joint angles, radians, from which limbs are sampled.
    """

    def __init__(self, model: BodyModel, views: PinholeViews, library_angles: NDArray[np.float64]):
        """Prepares the limbs' shapes and thins the recorded placements of each."""
        self.model, self.views = model, views
        self.surface = Surface(model)
        self.limbs = [LimbShape.from_model(model, name) for name in LIMB_NAMES]
        self.placements = [
            _thinned(library_angles[:, limb.dofs], ~model.dof_fixed[limb.dofs])
            for limb in self.limbs
        ]

    def resample(
        self, pose_frames: Sequence[PoseFrame], before: PoseFrame | None = None
    ) -> list[PoseFrame]:
        """Frames with every limb's trajectory chosen again, one limb after the other.

        Args:
            pose_frames: consecutive frames.
            before: the frame before the first, whose pose the trajectory continues.
        """
        pose_frames = list(pose_frames)
        for limb, placements in zip(self.limbs, self.placements, strict=True):
            frames = [self._candidates(limb, placements, pose_frame) for pose_frame in pose_frames]
            start = (
                []
                if before is None
                else [
                    _limb_candidates(
                        limb, before, before.pose.angles_rad[None, limb.dofs], np.zeros(1)
                    )
                ]
            )
            chosen = viterbi(
                [*start, *frames],
                ProcessNoise(
                    STEP_SIGMA_RAD[limb.dofs], spacing_rad=np.radians(6.0), restart_cost=30.0
                ),
            )
            for k, (choice, frame) in enumerate(zip(chosen[len(start) :], frames, strict=True)):
                pose = pose_frames[k].pose
                angles = pose.angles_rad.copy()
                angles[limb.dofs] = frame.angles_rad[choice]
                pose_frames[k] = replace(
                    pose_frames[k], pose=Pose(pose.root_m, pose.root_rotation, angles)
                )
        return pose_frames

    def refine(
        self, pose_frames: Sequence[PoseFrame], before: PoseFrame | None = None
    ) -> list[PoseFrame]:
        """Frames refined on their contours, first alone, then with their neighbours as prior."""
        dofs = self.model.dof_count
        near = np.concatenate([[0.08] * 3, [0.15] * 3, np.full(dofs, 0.15)])
        between = np.concatenate([[0.02] * 3, [0.04] * 3, np.maximum(STEP_SIGMA_RAD, 0.03)])
        observations = [pose_frame.observed.contour for pose_frame in pose_frames]
        poses = [
            self._refined(observation, pose_frame.pose, PosePrior(pose_frame.pose, near), _FIRST)
            for observation, pose_frame in zip(observations, pose_frames, strict=True)
        ]
        for _ in range(_ROUNDS):
            row = [None if before is None else before.pose, *poses, None]
            poses = [
                self._refined(
                    observation,
                    here,
                    PosePrior(neighbour_middle(left, here, right), between),
                    _POLISH,
                )
                for observation, left, here, right in zip(
                    observations, row, poses, row[2:], strict=False
                )
            ]
        return [
            replace(pose_frame, pose=pose)
            for pose_frame, pose in zip(pose_frames, poses, strict=True)
        ]

    def _refined(
        self, observation: Observation, pose: Pose, prior: PosePrior, settings: RefineSettings
    ) -> Pose:
        return refine(self.surface, observation, pose, prior, settings).pose

    def _candidates(
        self, limb: LimbShape, placements: NDArray[np.float64], pose_frame: PoseFrame
    ) -> PoseCandidates:
        """Likeliest placements of a limb, the pose's own among them."""
        angles = np.concatenate([pose_frame.pose.angles_rad[None, limb.dofs], placements])
        distance = pose_frame.observed.weights.limb_distances(
            self.model, limb, pose_frame.pose, angles
        )
        # A limb near its placement in the whole pose is likelier: the library knows which limb
        # placements occur together.
        deviation = (((angles - angles[0]) / _DEVIATION_RAD) ** 2).sum(1)
        log_likelihood = -0.5 * ((distance / _SIGMA) ** 2 + deviation)
        kept = np.unique(np.concatenate([[0], np.argsort(-log_likelihood, kind="stable")[:_KEPT]]))
        return _limb_candidates(limb, pose_frame, angles[kept], log_likelihood[kept])


def _limb_candidates(
    limb: LimbShape,
    pose_frame: PoseFrame,
    angles: NDArray[np.float64],
    log_likelihood: NDArray[np.float64],
) -> PoseCandidates:
    count = len(angles)
    root = (
        np.tile(pose_frame.pose.root_m, (count, 1)),
        np.tile(pose_frame.pose.root_rotation, (count, 1, 1)),
    )
    return PoseCandidates(
        *root,
        angles,
        np.zeros((count, len(limb.dofs)), bool),
        log_likelihood,
        pose_frame.observed.time_s,
    )


def _thinned(angles: NDArray[np.float64], shown: NDArray[np.bool_]) -> NDArray[np.float64]:
    return angles[thin_poses(np.ascontiguousarray(angles[:, shown]), _SPACING_RAD)]
