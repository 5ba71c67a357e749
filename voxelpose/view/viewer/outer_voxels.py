"""The voxels at a hull's surface, with what their colours tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from voxelpose.multiview.carving.observe import FrameObservation


@dataclass(frozen=True, eq=False)
class NearestBodies:
    """What lies next to the occupied voxels of a hull, (nx, ny, nz) each."""

    person: NDArray[np.int8]  # number of the fitted body; -1: the voxel is free, or there is none
    part: NDArray[np.int16]  # its part; -1 likewise
    distance_m: NDArray[np.float64]  # from the inside of that; inf likewise

    @classmethod
    def of_hull(
        cls, observation: FrameObservation, bodies: Sequence[Sequence[NDArray[np.float64]]]
    ) -> "NearestBodies":
        """Those of an observed hull; of each body P arrays (n, 3) of points that fill its parts,
        world, m; none of who is lost.
        """
        occupancy = observation.occupancy
        person, part = np.full(occupancy.shape, -1, np.int8), np.full(occupancy.shape, -1, np.int16)
        distance = np.full(occupancy.shape, np.inf)
        parts = [(k, p, points) for k, body in enumerate(bodies) for p, points in enumerate(body)]
        if parts:
            owner = np.repeat([(k, p) for k, p, _ in parts], [len(each) for *_, each in parts], 0)
            tree = KDTree(np.concatenate([points for *_, points in parts]))
            centres = observation.grid.centres(np.argwhere(occupancy))
            distance[occupancy], nearest = tree.query(centres)
            person[occupancy], part[occupancy] = owner[nearest].T
        return cls(person, part, distance)


@dataclass(frozen=True, eq=False)
class OuterVoxels:
    """Occupied voxels that touch one that is not."""

    centres_m: NDArray[np.float64]  # (n, 3), world
    cameras: NDArray[np.int64]  # (n,), how many see it, with nothing of the hull before it
    # What is next to it, (n,) each, see `NearestBodies`.
    person: NDArray[np.int8]
    part: NDArray[np.int16]
    distance_m: NDArray[np.float64]
    at_vertex: NDArray[np.int64]  # (V,), the voxel next to each vertex of the surface

    @classmethod
    def from_hull(
        cls, observation: FrameObservation, vertices_m: NDArray[np.float64], bodies: NearestBodies
    ) -> "OuterVoxels":
        """Outer voxels of an observed hull, which is not empty; its surface has vertices (V, 3),
        world, m.
        """
        padded = np.pad(observation.occupancy, 1)
        inner = padded.copy()
        for axis in range(3):
            inner &= np.roll(padded, 1, axis) & np.roll(padded, -1, axis)
        outer = np.argwhere((padded & ~inner)[1:-1, 1:-1, 1:-1])
        centres = observation.grid.centres(outer)
        index = tuple(outer.T)
        at_vertex = np.asarray(KDTree(centres).query(vertices_m)[1], np.int64)
        return cls(
            centres,
            _seen_by(observation, centres),
            bodies.person[index],
            bodies.part[index],
            bodies.distance_m[index],
            at_vertex,
        )


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
