"""Many placements of a part on the voxels.

Source: Iiyama, Kameda and Minoh, step (5). Reference: `reference.py`.
"""

import math

import numpy as np

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


@parallel_kernel
def voxel_cover(numbers, origin, voxel_size, points, rotations, translations, bits, empty, taken):
    """Marks the voxels that each placement covers.

    Fills bits (K, W) uint64, empty (K,), the number of points in empty space (-1) or outside the
    grid, and taken (K,), those in voxels that are taken (-2).
    """
    nx, ny, nz = numbers.shape
    for k in prange(rotations.shape[0]):
        r, t = rotations[k], translations[k]
        missed, shared = 0, 0
        for w in range(bits.shape[1]):
            bits[k, w] = np.uint64(0)
        for p in range(points.shape[0]):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            i = int(
                np.floor((r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + t[0] - origin[0]) / voxel_size)
            )
            j = int(
                np.floor((r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + t[1] - origin[1]) / voxel_size)
            )
            m = int(
                np.floor((r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + t[2] - origin[2]) / voxel_size)
            )
            if i < 0 or j < 0 or m < 0 or i >= nx or j >= ny or m >= nz:
                missed += 1
                continue
            voxel = numbers[i, j, m]
            if voxel >= 0:
                bits[k, voxel >> 6] |= np.uint64(1) << np.uint64(voxel & 63)
            elif voxel == -1:
                missed += 1
            else:
                shared += 1
        empty[k] = missed
        taken[k] = shared
