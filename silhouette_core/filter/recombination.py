"""From the filter's whole poses to poses that no library holds: limbs recombined over time, then drawn onto the contour.

Beyond paper A. Whole poses are coarse: for each arm and leg every recorded placement is weighed on the same silhouette distance, and the
course through the best ones that moves least is taken, so that a limb that hides itself stays where the motion model puts it. The
refinement is continuous, and pulled toward that course where the silhouette is silent, which is mostly in depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.filter.limbs import LIMB_NAMES, LimbShape, SignedPicture
from silhouette_core.filter.path import Candidates, Restlessness, best_path
from silhouette_core.fitting.observation import Observation, PinholeViews
from silhouette_core.fitting.pose import RESTLESS_RAD, Pose
from silhouette_core.fitting.refinement import PosePrior, RefineSettings, refine
from silhouette_core.fitting.surface import Surface
from silhouette_core.library.thinning import thin

_GRAIN_RAD = np.radians(12.0)
_KEPT = 60
_SIGMA = 0.04
_AWAY_RAD = np.radians(60.0)
_MIDDLE = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_POLISH = RefineSettings(reaches_m=(0.08, 0.06, 0.06))
_ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Shot:
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
    picture: SignedPicture
    distance_m: float
    time_s: float


class Recombiner:
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
        self.placements = [_thinned(library_angles[:, limb.dofs], ~model.dof_held[limb.dofs]) for limb in self.limbs]

    def recombine(self, shots: Sequence[Shot], before: Shot | None = None) -> list[Shot]:
        """Chooses every limb's course anew, one limb after the other.

        Args:
            shots: consecutive frames with a course of poses.
            before: the frame before the first, whose pose the course continues.
        """
        shots = list(shots)
        for limb, placements in zip(self.limbs, self.placements, strict=True):
            frames = [self._candidates(limb, placements, shot) for shot in shots]
            start = [] if before is None else [_limb_candidates(limb, before, before.pose.angles_rad[None, limb.dofs], np.zeros(1))]
            taken = best_path([*start, *frames], Restlessness(RESTLESS_RAD[limb.dofs], grain_rad=np.radians(6.0), jump=30.0))
            for k, (choice, frame) in enumerate(zip(taken[len(start) :], frames, strict=True)):
                pose = shots[k].pose
                angles = pose.angles_rad.copy()
                angles[limb.dofs] = frame.angles_rad[choice]
                shots[k] = replace(shots[k], pose=Pose(pose.root_m, pose.root_rotation, angles))
        return shots

    def refine(self, shots: Sequence[Shot], before: Shot | None = None) -> list[Shot]:
        """Draws every pose onto its contour, first alone, then toward the middle of its neighbours."""
        dofs = self.model.dof_count
        near = np.concatenate([[0.08] * 3, [0.15] * 3, np.full(dofs, 0.15)])
        smooth = np.concatenate([[0.02] * 3, [0.04] * 3, np.maximum(RESTLESS_RAD, 0.03)])
        seen = [Observation.of(self.views, [shot.mask], shot.distance_m) for shot in shots]
        poses = [self._refined(view, shot.pose, PosePrior(shot.pose, near), _MIDDLE) for view, shot in zip(seen, shots, strict=True)]
        for _ in range(_ROUNDS):
            row = [None if before is None else before.pose, *poses, None]
            poses = [
                self._refined(view, here, PosePrior(_middle(left, here, right), smooth), _POLISH)
                for view, left, here, right in zip(seen, row, poses, row[2:], strict=False)
            ]
        return [replace(shot, pose=pose) for shot, pose in zip(shots, poses, strict=True)]

    def _refined(self, seen: Observation, pose: Pose, prior: PosePrior, settings: RefineSettings) -> Pose:
        return refine(self.surface, seen, pose, prior, settings).pose

    def _candidates(self, limb: LimbShape, placements: NDArray[np.float64], shot: Shot) -> Candidates:
        """Keeps the likeliest placements, the pose's own among them."""
        angles = np.concatenate([shot.pose.angles_rad[None, limb.dofs], placements])
        distance = shot.picture.limb_distances(self.model, limb, shot.pose, angles)
        # A limb near its place in the whole pose is likelier: the library knows which limbs go together.
        away = (((angles - angles[0]) / _AWAY_RAD) ** 2).sum(1)
        log_likelihood = -0.5 * ((distance / _SIGMA) ** 2 + away)
        kept = np.unique(np.concatenate([[0], np.argsort(-log_likelihood, kind="stable")[:_KEPT]]))
        return _limb_candidates(limb, shot, angles[kept], log_likelihood[kept])


def _middle(left: Pose | None, here: Pose, right: Pose | None) -> Pose:
    return here if left is None or right is None else left.moved(0.5 * right.minus(left))


def _limb_candidates(limb: LimbShape, shot: Shot, angles: NDArray[np.float64], log_likelihood: NDArray[np.float64]) -> Candidates:
    count = len(angles)
    root = np.tile(shot.pose.root_m, (count, 1)), np.tile(shot.pose.root_rotation, (count, 1, 1))
    return Candidates(*root, angles, np.zeros((count, len(limb.dofs)), bool), log_likelihood, shot.time_s)


def _thinned(angles: NDArray[np.float64], shown: NDArray[np.bool_]) -> NDArray[np.float64]:
    return angles[thin(np.ascontiguousarray(angles[:, shown]), _GRAIN_RAD)]
