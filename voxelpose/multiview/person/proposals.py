"""What each camera alone proposes for a frame, and what all of them say together: where cameras
look the same way, their hull leaves open how far away, how tall and which way round a person is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.joint_placement import place_bodies
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.proposed_poses import ProposedPoses, load_pose_proposer
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import MEASURING
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tuning import PROPOSALS

_STARTED = 3  # poses of a camera that are placed


@dataclass(frozen=True, eq=False)
class FrameProposals:
    """What cameras propose for one frame.

    Attributes:
        poses: of each camera that shows a person, the pelvis where all cameras see it, for the
            stature that this asks for.
        stature_m: that stature.
    """

    poses: tuple[ProposedPoses, ...]
    stature_m: float

    @classmethod
    def of(cls, poses: Sequence[ProposedPoses], centers_m: NDArray[np.float64]) -> FrameProposals:
        """From the poses of cameras (C, 3) for the usual stature: somebody who is farther away by a
        factor, is taller by it.
        """
        alone = np.stack([one.priors[0].pelvis_m for one in poses])
        rays = alone - centers_m
        ranges = np.linalg.norm(rays, axis=1, keepdims=True)
        across = np.eye(3) - np.einsum("ci,cj->cij", rays / ranges, rays / ranges)
        pelvis = np.linalg.solve(across.sum(0), np.einsum("cij,cj->i", across, centers_m))
        factors = np.linalg.norm(pelvis - centers_m, axis=1) / ranges[:, 0]
        scale = float(np.exp(np.log(factors).mean()))
        return cls(tuple(one.at(pelvis, scale) for one in poses), scale * MEASURING.usual_m)

    def starts(self, surface: Surface, observation: Observation) -> list[Pose]:
        """Bodies placed as the cameras propose."""
        priors = [prior for one in self.poses for prior in one.probable(_STARTED)]
        return place_bodies(surface, observation, priors)

    def cost(self, joints_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost (K,), nats, of poses with joints (K, 15, 3), m: the mean of the cameras'."""
        return np.mean([one.cost(joints_m) for one in self.poses], axis=0)


def proposals_of(
    observations: ObservationStore, frames: Sequence[int], fps: float
) -> Mapping[int, FrameProposals]:
    """What cameras propose for some frames, as far as two of them show somebody."""
    proposer, rig = load_pose_proposer(), observations.observer.views.rig
    beside = np.unique(np.rint(np.array(PROPOSALS.beside_s) * fps).astype(int))

    def proposed(t: int) -> FrameProposals | None:
        near = [int(k) for k in t + beside if 0 <= k < len(observations)]
        times, masks = [k / fps for k in near], [observations.masks(k) for k in near]
        found = {
            c: poses
            for c, camera in enumerate(rig)
            if (
                poses := proposer.propose(
                    camera, MEASURING.usual_m, times, [one[c] for one in masks], near.index(t)
                )
            )
            is not None
        }
        if len(found) < 2:
            return None
        return FrameProposals.of([*found.values()], observations.observer.views.center_m[[*found]])

    every = side_by_side(proposed, list(frames))
    return {t: one for t, one in zip(frames, every, strict=True) if one is not None}
