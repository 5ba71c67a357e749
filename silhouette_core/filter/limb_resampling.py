"""From the filter's whole poses to poses that no library holds: limbs recombined over time, then
drawn onto the contour.

Beyond paper A. Whole poses are coarse: for each arm and leg every recorded placement is weighed on
the same silhouette distance, and the course through the best ones that moves least is taken, so
that a limb that hides itself stays where the motion model puts it. The refinement is continuous,
and pulled toward that course where the silhouette is silent, which is mostly in depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.filter.limb_silhouette import LIMB_NAMES, LimbShape, SignedWeights
from silhouette_core.filter.motion_cost import PoseCandidates, ProcessNoise, viterbi
from silhouette_core.library.thinning import thin_poses
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.pose import STEP_SIGMA_RAD, Pose
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.surface import Surface

_GRAIN_RAD = np.radians(12.0)
_KEPT = 60
_SIGMA = 0.04
_AWAY_RAD = np.radians(60.0)
_MIDDLE = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_POLISH = RefineSettings(reaches_m=(0.08, 0.06, 0.06))
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """A frame and its pose so far.

    Attributes:
        pose: to be improved.
        mask: (h, w) bool, the silhouette in the camera's picture.
        picture: the same as a sum, for the limbs.
        distance_m: of the person.
        time_s: of the frame.
    """

    pose: Pose
    mask: NDArray[np.bool_]
    picture: SignedWeights
    distance_m: float
    time_s: float


class LimbResampler:
    """Improves courses of poses.

    Args:
        model: the body.
        views: the camera.
        library_angles: (B, D) recorded joint angles, from which limbs are taken.
    """

    def __init__(self, model: BodyModel, views: PinholeViews, library_angles: NDArray[np.float64]):
        """Cuts the limbs out of the body and thins what was recorded of each."""
        self.model, self.views = model, views
        self.surface = Surface(model)
        self.limbs = [LimbShape.of(model, name) for name in LIMB_NAMES]
        self.placements = [
            _thinned(library_angles[:, limb.dofs], ~model.dof_fixed[limb.dofs])
            for limb in self.limbs
        ]

    def resample(
        self, pose_frames: Sequence[PoseFrame], before: PoseFrame | None = None
    ) -> list[PoseFrame]:
        """Chooses every limb's course anew, one limb after the other.

        Args:
            pose_frames: consecutive frames with a course of poses.
            before: the frame before the first, whose pose the course continues.
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
            taken = viterbi(
                [*start, *frames],
                ProcessNoise(STEP_SIGMA_RAD[limb.dofs], grain_rad=np.radians(6.0), jump=30.0),
            )
            for k, (choice, frame) in enumerate(zip(taken[len(start) :], frames, strict=True)):
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
        """Draws every pose onto its contour, first alone, then toward the middle of its neighbours."""
        dofs = self.model.dof_count
        near = np.concatenate([[0.08] * 3, [0.15] * 3, np.full(dofs, 0.15)])
        smooth = np.concatenate([[0.02] * 3, [0.04] * 3, np.maximum(STEP_SIGMA_RAD, 0.03)])
        seen = [
            Observation.of(self.views, [pose_frame.mask], pose_frame.distance_m)
            for pose_frame in pose_frames
        ]
        poses = [
            self._refined(view, pose_frame.pose, PosePrior(pose_frame.pose, near), _MIDDLE)
            for view, pose_frame in zip(seen, pose_frames, strict=True)
        ]
        for _ in range(_ROUNDS):
            row = [None if before is None else before.pose, *poses, None]
            poses = [
                self._refined(view, here, PosePrior(_middle(left, here, right), smooth), _POLISH)
                for view, left, here, right in zip(seen, row, poses, row[2:], strict=False)
            ]
        return [
            replace(pose_frame, pose=pose)
            for pose_frame, pose in zip(pose_frames, poses, strict=True)
        ]

    def _refined(
        self, seen: Observation, pose: Pose, prior: PosePrior, settings: RefineSettings
    ) -> Pose:
        return refine(self.surface, seen, pose, prior, settings).pose

    def _candidates(
        self, limb: LimbShape, placements: NDArray[np.float64], pose_frame: PoseFrame
    ) -> PoseCandidates:
        """Keeps the likeliest placements, the pose's own among them."""
        angles = np.concatenate([pose_frame.pose.angles_rad[None, limb.dofs], placements])
        distance = pose_frame.picture.limb_distances(self.model, limb, pose_frame.pose, angles)
        # A limb near its place in the whole pose is likelier: the library knows which limbs go
        # together.
        away = (((angles - angles[0]) / _AWAY_RAD) ** 2).sum(1)
        log_likelihood = -0.5 * ((distance / _SIGMA) ** 2 + away)
        kept = np.unique(np.concatenate([[0], np.argsort(-log_likelihood, kind="stable")[:_KEPT]]))
        return _limb_candidates(limb, pose_frame, angles[kept], log_likelihood[kept])


def _middle(left: Pose | None, here: Pose, right: Pose | None) -> Pose:
    return here if left is None or right is None else left.moved(0.5 * right.minus(left))


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
        *root, angles, np.zeros((count, len(limb.dofs)), bool), log_likelihood, pose_frame.time_s
    )


def _thinned(angles: NDArray[np.float64], shown: NDArray[np.bool_]) -> NDArray[np.float64]:
    return angles[thin_poses(np.ascontiguousarray(angles[:, shown]), _GRAIN_RAD)]
