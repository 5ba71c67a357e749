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
        total = 0
        for p in range(points.shape[0]):
            a, b, c = points[p, 0], points[p, 1], points[p, 2]
            x = r[0, 0] * a + r[0, 1] * b + r[0, 2] * c + t[0]
            y = r[1, 0] * a + r[1, 1] * b + r[1, 2] * c + t[1]
            z = r[2, 0] * a + r[2, 1] * b + r[2, 2] * c + t[2]
            for v in range(cameras):
                q, s = camera_rotation[v], camera_translation[v]
                depth = q[2, 0] * x + q[2, 1] * y + q[2, 2] * z + s[2]
                if depth < 0.05:
                    continue
                column = (
                    intrinsics[v, 0] * (q[0, 0] * x + q[0, 1] * y + q[0, 2] * z + s[0]) / depth
                    + intrinsics[v, 2]
                )
                row = (
                    intrinsics[v, 1] * (q[1, 0] * x + q[1, 1] * y + q[1, 2] * z + s[1]) / depth
                    + intrinsics[v, 3]
                )
                i, j = int(np.floor(row + 0.5)), int(np.floor(column + 0.5))
                if 0 <= i < height and 0 <= j < width:
                    total += images[v, i, j]
        scores[k] = total
