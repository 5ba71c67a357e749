"""Poses that cameras propose for a frame: what each alone proposes, said together, since where they
look the same way their hull leaves open how far away, how tall and which way round a person is; and
the joints that the pose network sees in several, triangulated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from calib.checks import FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES, SIDES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import STATURES_M, BodySizes
from silhouette_core.image.seen_joints import SeenJoints, deviations_m
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.proposed_poses import (
    ProposedPoses,
    load_pose_proposer,
    place_bodies,
)
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import MEASURING, REFINEMENT
from voxelpose.multiview.silhouettes.observation_store import ObservationStore

_STARTED = 3  # poses of a camera that are placed
_READ = 15  # frames a second


@dataclass(frozen=True, eq=False)
class FrameProposals:
    """What cameras propose for one frame."""

    poses: tuple[ProposedPoses, ...]
    """Of each camera that shows a person, the pelvis where all cameras see it, of somebody of the
    stature."""
    stature_m: float  #: what is known, else what the pelvis's place asks for.

    @classmethod
    def of(
        cls, poses: Sequence[ProposedPoses], centers_m: FloatArray, stature_m: float | None = None
    ) -> "FrameProposals":
        """From the poses of cameras (C, 3) for the usual stature: somebody who is farther away by a
        factor, is taller by it. The stature, m, may be known.
        """
        alone = np.stack([one.priors[0].pelvis_m for one in poses])
        rays = alone - centers_m
        ranges = np.linalg.norm(rays, axis=1, keepdims=True)
        across = np.eye(3) - np.einsum("ci,cj->cij", rays / ranges, rays / ranges)
        middle = alone.mean(axis=0)  # where rays that never meet leave the pelvis
        met = np.einsum("cij,cj->i", across, centers_m - middle)
        pelvis = middle + np.linalg.lstsq(across.sum(axis=0), met)[0]
        if stature_m is None:
            factors = np.linalg.norm(pelvis - centers_m, axis=1) / ranges[:, 0]
            metres = MEASURING.usual_m * np.exp(np.log(factors).mean())
            stature_m = float(np.clip(metres, *STATURES_M))
        scale = stature_m / MEASURING.usual_m
        return cls(tuple(one.at(pelvis, scale) for one in poses), stature_m)

    def starts(self, surface: Surface, observation: Observation) -> list[Pose]:
        """Bodies placed as the cameras propose."""
        priors = [prior for one in self.poses for prior in one.probable(_STARTED)]
        return place_bodies(surface, observation, priors)

    def cost(self, joints_m: FloatArray) -> FloatArray:
        """Cost (K,), nats, of poses with joints (K, 15, 3), m: the mean of the cameras'."""
        return np.mean([one.cost(joints_m) for one in self.poses], axis=0)


def proposals_of(
    observations: ObservationStore, frames: Sequence[int], fps: float, stature_m: float | None
) -> Mapping[int, FrameProposals]:
    """What cameras propose for some frames, as far as two of them show somebody; who walks shows
    which way round, so that all of the recording is read.
    """
    views = observations.observer.views
    proposer, step = load_pose_proposer(), max(round(fps / _READ), 1)
    read = sorted({*range(0, len(observations), step), *frames})

    def proposed(camera: int) -> dict[int, ProposedPoses | None]:
        pictures = ((t / fps, observations.masks(t)[camera]) for t in read)
        poses = proposer.propose(views.rig.cameras[camera], MEASURING.usual_m, pictures)
        return dict(zip(read, poses, strict=True))

    cameras, proposals = range(len(views.rig)), {}
    each = side_by_side(proposed, cameras)
    for t in frames:
        seen = {c: poses for c in cameras if (poses := each[c][t]) is not None}
        if len(seen) > 1:
            proposals[t] = FrameProposals.of([*seen.values()], views.center_m[[*seen]], stature_m)
    return proposals


_ROUNDS = 5  # of reweighting
_LIMBS = "hip knee", "knee ankle", "shoulder elbow", "elbow wrist"
_ENDS = [f"{side}_{name}" for side in SIDES for limb in _LIMBS for name in limb.split()]
_BONES = np.array([LANDMARK_NAMES.index(name) for name in ("pelvis", "neck", *_ENDS)]).reshape(
    -1, 2
)


def triangulated_proposals(
    observations: ObservationStore, frames: Sequence[int], stature_m: float | None
) -> Mapping[int, FrameProposals]:
    """What the network's points say of some frames in which two cameras see the person.

    Args:
        observations: with the joints that are seen.
        frames: their numbers.
        stature_m: what is known; None: as long bones say.
    """
    views = observations.observer.views
    poses = {
        t: prior
        for t in frames
        if (prior := triangulated(observations.joints(t), views)) is not None
    }
    if not poses:
        return {}
    if stature_m is None:
        longer = [bone_length_m(one.relative_m) for one in poses.values()]
        metres = MEASURING.usual_m * float(np.median(longer)) / _usual_length_m()
        stature_m = float(np.clip(metres, *STATURES_M))
    return {
        t: FrameProposals((ProposedPoses(np.ones(1), [prior]),), stature_m)
        for t, prior in poses.items()
    }


def triangulated(seen: Mapping[int, SeenJoints], views: PinholeViews) -> LandmarkPrior | None:
    r"""Joints nearest to their viewing rays, by the deviations across these; robust.

    .. math:: \min_x \sum_c \rho\bigl(|(I - d_c d_c^T)(x - o_c)| / \sigma_c\bigr)

    Args:
        seen: joints by the camera's number.
        views: pinhole cameras.

    Returns:
        The joints and their precision; None where fewer than two cameras see somebody.

    Source: textbook (triangulation by rays, reweighted least squares).
    """
    if len(seen) < 2:
        return None
    centres = views.center_m[[*seen]]
    rays = np.stack([one.rays @ views.rotation[c] for c, one in seen.items()])
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    sigma = np.stack([deviations_m(one.visibility) for one in seen.values()])
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    freedom, weight = REFINEMENT.student_freedom, sigma**-2

    def nearest() -> tuple[FloatArray, FloatArray]:
        precision = np.einsum("cl,clij->lij", weight, across)
        target = np.einsum("cl,clij,cj->li", weight, across, centres)
        return np.linalg.solve(precision, target[..., None])[..., 0], precision

    joints, precision = nearest()
    for _ in range(_ROUNDS):
        offsets = np.einsum("clij,clj->cli", across, joints - centres[:, None])
        square = (offsets**2).sum(axis=2) / sigma**2
        weight = sigma**-2 * (freedom + 2) / (freedom + square)
        joints, precision = nearest()
    return LandmarkPrior(joints - joints[0], precision, joints[0], precision[0])


def bone_length_m(joints_m: FloatArray) -> float:
    """Length of trunk and limbs together, of joints (15, 3), m."""
    first, second = _BONES.T
    return float(np.linalg.norm(joints_m[first] - joints_m[second], axis=1).sum())


@cache
def _usual_length_m() -> float:
    """`bone_length_m` of somebody of the usual stature."""
    return bone_length_m(BodyModel.from_sizes(BodySizes(MEASURING.usual_m)).landmarks_m)
