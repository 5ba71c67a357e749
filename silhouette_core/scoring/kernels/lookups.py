"""Placed points looked up: in the images of several cameras, and on the voxels.

The pixels or voxels of all points are computed first, by vector instructions, and looked up then:
one loop for both is half as fast.

Source: on voxels Iiyama, Kameda and Minoh, step (5); else this project. Reference:
`tests.oracles.scoring`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def _number_pixels(columns, projection, height, width, numbers):
    """Fills numbers (P,): the pixel at which a camera, projection (3, 4), sees each point of
    columns (3, P), counted through its image; -1 outside of it, or too near.
    """
    xs, ys, zs = columns[0], columns[1], columns[2]
    a0, a1, a2, a3 = projection[0, 0], projection[0, 1], projection[0, 2], projection[0, 3]
    b0, b1, b2, b3 = projection[1, 0], projection[1, 1], projection[1, 2], projection[1, 3]
    c0, c1, c2, c3 = projection[2, 0], projection[2, 1], projection[2, 2], projection[2, 3]
    for p in range(len(xs)):
        x, y, z = xs[p], ys[p], zs[p]
        depth = c0 * x + c1 * y + c2 * z + c3
        near = 1.0 / depth
        column = (a0 * x + a1 * y + a2 * z + a3) * near + 0.5
        row = (b0 * x + b1 * y + b2 * z + b3) * near + 0.5
        within = (depth >= 0.05) & (row >= 0) & (column >= 0) & (row < height) & (column < width)
        # No branch: what lies outside is computed, too, within the range of integers.
        row, column = min(max(row, 0.0), height), min(max(column, 0.0), width)
        number = np.int32(row) * width + np.int32(column)
        numbers[p] = number if within else -1


@parallel_kernel
def pixel_scores(
    points, rotations, translations, intrinsics, camera_rotation, camera_translation, images, scores
):
    """Fills scores (K,): the pixels of images (C, h, w) int8 to which each placement's points
    project, summed over cameras and points.
    """
    cameras, height, width = images.shape
    columns = points.T.copy()
    for k in prange(rotations.shape[0]):
        r, t = rotations[k], translations[k]
        m, numbers = np.empty((3, 4)), np.empty(len(points), np.int32)
        total = 0
        for v in range(cameras):
            # From a point of the part to pixels times depth.
            q = camera_rotation[v]
            for i in range(3):
                for j in range(3):
                    m[i, j] = q[i, 0] * r[0, j] + q[i, 1] * r[1, j] + q[i, 2] * r[2, j]
                m[i, 3] = (
                    q[i, 0] * t[0] + q[i, 1] * t[1] + q[i, 2] * t[2] + camera_translation[v, i]
                )
            for j in range(4):
                m[0, j] = intrinsics[v, 0] * m[0, j] + intrinsics[v, 2] * m[2, j]
                m[1, j] = intrinsics[v, 1] * m[1, j] + intrinsics[v, 3] * m[2, j]
            _number_pixels(columns, m, height, width, numbers)
            image = images[v].reshape(-1)
            for p in range(len(numbers)):
                if numbers[p] >= 0:
                    total += image[numbers[p]]
        scores[k] = total


@kernel
def _number_cells(columns, rotation, translation, origin, per_voxel, shape, cells):
    """Fills cells (P,): the voxel, counted through the grid, of columns (3, P); -1 outside it."""
    xs, ys, zs = columns[0], columns[1], columns[2]
    nx, ny, nz = shape
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    t0, t1, t2 = translation[0], translation[1], translation[2]
    o0, o1, o2 = origin[0], origin[1], origin[2]
    for p in range(len(xs)):
        x, y, z = xs[p], ys[p], zs[p]
        i = ((((x * r00 + y * r01) + z * r02) + t0) - o0) * per_voxel
        j = ((((x * r10 + y * r11) + z * r12) + t1) - o1) * per_voxel
        m = ((((x * r20 + y * r21) + z * r22) + t2) - o2) * per_voxel
        within = (i >= 0) & (j >= 0) & (m >= 0) & (i < nx) & (j < ny) & (m < nz)
        # No branch: what lies outside is computed, too, within the range of integers.
        i, j, m = min(max(i, 0.0), nx), min(max(j, 0.0), ny), min(max(m, 0.0), nz)
        cell = (np.int32(i) * ny + np.int32(j)) * nz + np.int32(m)
        cells[p] = cell if within else -1


@parallel_kernel
def voxel_overlap(
    occupancy, origin, per_voxel, points, weights, rotations, translations, inside, outside
):
    """Fills inside (K,) and outside (K,): weights of points in occupied voxels and others."""
    flat, columns = occupancy.reshape(-1), points.T.copy()
    for k in prange(len(rotations)):
        cells = np.empty(len(points), np.int32)
        turn, move = rotations[k], translations[k]
        _number_cells(columns, turn, move, origin, per_voxel, occupancy.shape, cells)
        full, empty = 0.0, 0.0
        for p in range(len(cells)):
            if cells[p] >= 0 and flat[cells[p]]:
                full += weights[p]
            else:
                empty += weights[p]
        inside[k] = full
        outside[k] = empty


@parallel_kernel
def voxel_cover(numbers, origin, per_voxel, points, rotations, translations, bits, empty, taken):
    """Marks the voxels that each placement covers.

    Fills bits (K, W) uint64, empty (K,), the number of points in empty space (-1) or outside the
    grid, and taken (K,), those in voxels that are taken (-2).
    """
    flat, columns = numbers.reshape(-1), points.T.copy()
    for k in prange(len(rotations)):
        cells = np.empty(len(points), np.int32)
        turn, move = rotations[k], translations[k]
        _number_cells(columns, turn, move, origin, per_voxel, numbers.shape, cells)
        missed, shared = 0, 0
        for w in range(bits.shape[1]):
            bits[k, w] = np.uint64(0)
        for p in range(len(cells)):
            voxel = flat[cells[p]] if cells[p] >= 0 else -1
            if voxel >= 0:
                bits[k, voxel >> 6] |= np.uint64(1) << np.uint64(voxel & 63)
            elif voxel == -1:
                missed += 1
            else:
                shared += 1
        empty[k] = missed
        taken[k] = shared
