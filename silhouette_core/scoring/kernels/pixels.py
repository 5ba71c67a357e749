"""Placed points looked up in the images of several cameras.

The pixels of all points are computed first, by vector instructions, and looked up then: one loop
for both is half as fast.

Source: this project. Reference: `tests.oracles.scoring`.
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
