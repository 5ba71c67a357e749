"""The voxels at a hull's surface, with what their colours tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from voxelpose.multiview.carving.observe import FrameObservation


@dataclass(frozen=True, eq=False)
class OuterVoxels:
    """Occupied voxels that touch one that is not."""

    centres_m: NDArray[np.float64]  # (n, 3), world
    cameras: NDArray[np.int64]  # (n,), how many see it, with nothing of the hull before it
    part: NDArray[np.int64]  # (n,), part of the fitted bodies next to it; -1: there is no body
    distance_m: NDArray[np.float64]  # (n,), from the inside of that; inf: there is no body
    at_vertex: NDArray[np.int64]  # (V,), the voxel next to each vertex of the surface

    @classmethod
    def from_hull(
        cls,
        observation: FrameObservation,
        vertices_m: NDArray[np.float64],
        bodies: Sequence[Sequence[NDArray[np.float64]]],
    ) -> "OuterVoxels":
        """Outer voxels of an observed hull, which is not empty.

        Args:
            observation: the hull and the silhouettes.
            vertices_m: (V, 3) of its surface, world.
            bodies: of each, P arrays (n, 3) of points that fill its parts, world, m.
        """
        padded = np.pad(observation.occupancy, 1)
        inner = padded.copy()
        for axis in range(3):
            inner &= np.roll(padded, 1, axis) & np.roll(padded, -1, axis)
        outer = np.argwhere((padded & ~inner)[1:-1, 1:-1, 1:-1])
        centres = observation.grid.centres(outer)
        part, distance = np.full(len(outer), -1), np.full(len(outer), np.inf)
        if bodies:
            points = np.concatenate([points for parts in bodies for points in parts])
            owner = np.concatenate(
                [np.full(len(points), p) for parts in bodies for p, points in enumerate(parts)]
            )
            distance, nearest = KDTree(points).query(centres)
            part, distance = owner[nearest], np.asarray(distance, float)
        at_vertex = np.asarray(KDTree(centres).query(vertices_m)[1], np.int64)
        return cls(centres, _seen_by(observation, centres), part, distance, at_vertex)


def _seen_by(observation: FrameObservation, points_m: NDArray[np.float64]) -> NDArray[np.int64]:
    """By how many cameras outer voxels (n, 3) m are seen, (n,): nothing of the hull is before them.

    Pictures are divided into cells as large as a voxel there, and what is nearest in a cell, to
    within two voxels, is seen.
    """
    count, size_m = np.zeros(len(points_m), np.int64), observation.grid.voxel_size_m
    for camera in observation.views.rig:
        pixels, depth_m = camera.project(points_m)
        inside = np.isfinite(pixels).all(axis=1) & (depth_m > 0)
        inside &= (pixels >= -0.5).all(axis=1) & (pixels < np.array(camera.size) - 0.5).all(axis=1)
        if not inside.any():
            continue
        depth = depth_m[inside]
        cell = np.floor(pixels[inside] / (camera.matrix[0, 0] * size_m / np.median(depth)))
        _, number = np.unique(cell, axis=0, return_inverse=True)
        nearest = np.full(number.max() + 1, np.inf)
        np.minimum.at(nearest, number.ravel(), depth)
        count[inside] += depth <= nearest[number.ravel()] + 2 * size_m
    return count
