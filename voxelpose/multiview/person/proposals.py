"""What each camera alone proposes for a frame, and what all of them say together: where cameras
look the same way, their hull leaves open how far away, how tall and which way round a person is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.sizes import STATURES_M
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.joint_placement import place_bodies
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.proposed_poses import ProposedPoses, load_pose_proposer
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import MEASURING
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
        cls,
        poses: Sequence[ProposedPoses],
        centers_m: NDArray[np.float64],
        stature_m: float | None = None,
    ) -> FrameProposals:
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

    def cost(self, joints_m: NDArray[np.float64]) -> NDArray[np.float64]:
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
        shown = ((t / fps, observations.masks(t)[camera]) for t in read)
        poses = proposer.propose(views.rig.cameras[camera], MEASURING.usual_m, shown)
        return dict(zip(read, poses, strict=True))

    cameras, found = range(len(views.rig)), {}
    each = side_by_side(proposed, cameras)
    for t in frames:
        seen = {c: poses for c in cameras if (poses := each[c][t]) is not None}
        if len(seen) > 1:
            found[t] = FrameProposals.of([*seen.values()], views.center_m[[*seen]], stature_m)
    return found
