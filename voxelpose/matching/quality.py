"""What a fitted pose explains of the hull, part by part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.motion.kinematics import forward, quaternions
from silhouette_core.refinement.pose import Pose
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.observe import FrameObservation
from voxelpose.matching.voxel_set import VoxelSet

_UNSUPPORTED = 0.2


@dataclass(frozen=True, eq=False)
class Quality:
    """How one frame's pose and hull lie over each other.

    Attributes: part_overlap: (27,) share of each part's volume inside the hull; NaN for one smaller
        than a voxel. part_unsupported: (27,) bool, hardly any voxel speaks for the part.
        unexplained: share of the hull's voxels that no part covers. A hull of few cameras is larger
        than the body in it. unexplained_voxels: (n, 3) int64, those voxels' indices in the sight's
        grid.
    """

    part_overlap: np.ndarray
    part_unsupported: np.ndarray
    unexplained: float
    unexplained_voxels: np.ndarray


def assess(body_volume: BodyVolume, pose: Pose, observed: FrameObservation) -> Quality:
    """Lays a posed body over the hull."""
    voxel_set = VoxelSet(observed.grid, observed.occupancy)
    rotation, origin = forward(
        body_volume.model,
        pose.root_m[None],
        quaternions(pose.root_rotation[None]),
        pose.angles_rad[None],
    )
    overlap = np.full(len(body_volume.model.names), np.nan)
    union = np.zeros(voxel_set.words, np.uint64)
    for part, points in enumerate(body_volume.part_points):
        if len(points):
            bits, empty, _ = voxel_set.cover(points, rotation[0, part][None], origin[0, part][None])
            overlap[part] = 1 - empty[0] / len(points)
            union |= bits[0]
    unexplained = voxel_set.voxels(~union)
    return Quality(
        overlap, overlap < _UNSUPPORTED, len(unexplained) / max(len(voxel_set), 1), unexplained
    )
