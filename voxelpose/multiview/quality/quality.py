"""Agreement of a fitted pose with the hull, part by part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.motion.kinematics import forward, quaternions
from silhouette_core.motion.pose import Pose
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.voxel_set import VoxelSet
from voxelpose.multiview.tuning import QUALITY


@dataclass(frozen=True, eq=False)
class Quality:
    """Agreement of one frame's pose with the hull.

    A hull of few cameras is larger than the body in it.

    Attributes:
        part_overlap: (27,) float64, fraction of each part's volume inside the hull; NaN for a part
            smaller than a voxel.
        part_unsupported: (27,) bool, parts that hardly overlap the hull.
        unexplained: fraction of the hull's voxels that no part covers, nor a neighbour of which:
            a part's points leave gaps of a voxel.
        unexplained_voxels: (n, 3) int64, indices of those voxels in the frame's grid.
    """

    part_overlap: np.ndarray
    part_unsupported: np.ndarray
    unexplained: float
    unexplained_voxels: np.ndarray


def assess(body_volume: BodyVolume, pose: Pose, frame: FrameObservation) -> Quality:
    """Agreement of a posed body with a frame's hull."""
    voxel_set = VoxelSet(frame.grid, frame.occupancy, body_volume.backend)
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
    covered = np.zeros(frame.occupancy.shape, bool)
    covered[tuple(voxel_set.voxels(union).T)] = True
    unexplained = np.argwhere(frame.occupancy & ~_dilated(covered))
    return Quality(
        overlap,
        overlap < QUALITY.unsupported,
        len(unexplained) / max(len(voxel_set), 1),
        unexplained,
    )


def _dilated(mask: np.ndarray) -> np.ndarray:
    """A volume with all neighbours of its voxels, those at corners included."""
    for axis in range(mask.ndim):
        moved = np.moveaxis(mask, axis, 0)
        wider = moved.copy()
        wider[1:] |= moved[:-1]
        wider[:-1] |= moved[1:]
        mask = np.moveaxis(wider, 0, axis)
    return mask
