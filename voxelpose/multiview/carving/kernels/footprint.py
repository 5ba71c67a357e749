"""Pixels into which the voxels of a hull project.

Source: pinhole projection, textbook. Reference:
`tests.oracles.carving.mark_voxels`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def mark_voxels(occupancy, x, y, z, projection, footprint):
    """Marks the nearest pixel of each occupied voxel's centre in footprint (h, w) uint8.

    occupancy is (nx, ny, nz) bool, x (nx,), y (ny,) and z (nz,) are world coordinates of centres,
    m, and projection (3, 4) leads to pixels times depth. Returns the least depth, m, of an occupied
    voxel; infinite if there is none.
    """
    height, width = footprint.shape
    nearest = np.inf
    for i in range(occupancy.shape[0]):
        for j in range(occupancy.shape[1]):
            u = projection[0, 0] * x[i] + projection[0, 1] * y[j] + projection[0, 3]
            v = projection[1, 0] * x[i] + projection[1, 1] * y[j] + projection[1, 3]
            w = projection[2, 0] * x[i] + projection[2, 1] * y[j] + projection[2, 3]
            for k in range(occupancy.shape[2]):
                if not occupancy[i, j, k]:
                    continue
                depth = w + projection[2, 2] * z[k]
                nearest = min(nearest, depth)
                if depth <= 0.0:
                    continue
                column = np.rint((u + projection[0, 2] * z[k]) / depth)
                row = np.rint((v + projection[1, 2] * z[k]) / depth)
                if 0.0 <= column < width and 0.0 <= row < height:
                    footprint[int(row), int(column)] = 1
    return nearest
