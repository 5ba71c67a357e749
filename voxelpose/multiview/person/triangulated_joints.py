"""Joints that the pose network sees in several cameras, triangulated: poses to begin with, and how
tall somebody is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import STATURES_M, BodySizes
from silhouette_core.image.seen_joints import SeenJoints, deviations_m
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.proposed_poses import ProposedPoses
from silhouette_core.tuning import MEASURING, REFINEMENT
from voxelpose.multiview.person.proposals import FrameProposals
from voxelpose.multiview.silhouettes.observation_store import ObservationStore

_ROUNDS = 5  # of reweighting
_LIMBS = "hip knee", "knee ankle", "shoulder elbow", "elbow wrist"
_ENDS = [f"{side}_{name}" for side in ("left", "right") for limb in _LIMBS for name in limb.split()]
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

    def nearest() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def bone_length_m(joints_m: NDArray[np.float64]) -> float:
    """Length of trunk and limbs together, of joints (15, 3), m."""
    first, second = _BONES.T
    return float(np.linalg.norm(joints_m[first] - joints_m[second], axis=1).sum())


@cache
def _usual_length_m() -> float:
    """`bone_length_m` of somebody of the usual stature."""
    return bone_length_m(BodyModel.from_sizes(BodySizes(MEASURING.usual_m)).landmarks_m)
