"""Voxel overlap of many placements."""

import math

from silhouette_core.jit import parallel_kernel, prange


@parallel_kernel
def voxel_overlap(
    occupancy, origin, per_voxel, points, weights, rotations, translations, inside, outside
):
    """Fills inside (K,) and outside (K,): the weights of points in occupied voxels, and of all
    others.
    """
    nx, ny, nz = occupancy.shape
    for k in prange(len(rotations)):
        r, t = rotations[k], translations[k]
        full, empty = 0.0, 0.0
        for p in range(len(points)):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            i = math.floor(
                ((((x * r[0, 0] + y * r[0, 1]) + z * r[0, 2]) + t[0]) - origin[0]) * per_voxel
            )
            j = math.floor(
                ((((x * r[1, 0] + y * r[1, 1]) + z * r[1, 2]) + t[1]) - origin[1]) * per_voxel
            )
            m = math.floor(
                ((((x * r[2, 0] + y * r[2, 1]) + z * r[2, 2]) + t[2]) - origin[2]) * per_voxel
            )
            if i >= 0 and j >= 0 and m >= 0 and i < nx and j < ny and m < nz and occupancy[i, j, m]:
                full += weights[p]
            else:
                empty += weights[p]
        inside[k] = full
        outside[k] = empty
