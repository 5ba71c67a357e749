"""Placed points looked up in the images of several cameras.

Source: this project. Reference: `reference.py`.
"""

import numpy as np

from silhouette_core.jit import parallel_kernel, prange


@parallel_kernel
def pixel_scores(
    points, rotations, translations, intrinsics, camera_rotation, camera_translation, images, scores
):
    """Fills scores (K,): the pixels of images (C, h, w) int8 to which each placement's points
    project, summed over cameras and points.
    """
    cameras, height, width = images.shape
    for k in prange(rotations.shape[0]):
        r, t = rotations[k], translations[k]
        # From a point of the part to pixels times depth, for every camera.
        m = np.empty((cameras, 3, 4))
        for v in range(cameras):
            q = camera_rotation[v]
            for i in range(3):
                for j in range(3):
                    m[v, i, j] = q[i, 0] * r[0, j] + q[i, 1] * r[1, j] + q[i, 2] * r[2, j]
                m[v, i, 3] = (
                    q[i, 0] * t[0] + q[i, 1] * t[1] + q[i, 2] * t[2] + camera_translation[v, i]
                )
            for j in range(4):
                m[v, 0, j] = intrinsics[v, 0] * m[v, 0, j] + intrinsics[v, 2] * m[v, 2, j]
                m[v, 1, j] = intrinsics[v, 1] * m[v, 1, j] + intrinsics[v, 3] * m[v, 2, j]
        total = 0
        for p in range(points.shape[0]):
            a, b, c = points[p, 0], points[p, 1], points[p, 2]
            for v in range(cameras):
                depth = m[v, 2, 0] * a + m[v, 2, 1] * b + m[v, 2, 2] * c + m[v, 2, 3]
                if depth < 0.05:
                    continue
                near = 1.0 / depth
                column = (m[v, 0, 0] * a + m[v, 0, 1] * b + m[v, 0, 2] * c + m[v, 0, 3]) * near
                row = (m[v, 1, 0] * a + m[v, 1, 1] * b + m[v, 1, 2] * c + m[v, 1, 3]) * near
                i, j = int(np.floor(row + 0.5)), int(np.floor(column + 0.5))
                if 0 <= i < height and 0 <= j < width:
                    total += images[v, i, j]
        scores[k] = total
