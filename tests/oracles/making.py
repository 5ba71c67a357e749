"""The kernels of this folder in NumPy, as close to their definitions as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np


def spoil_silhouettes(masks, edges, discs):
    """Neighbours to the left and above of the foreground or of the background, then discs."""
    y, x = np.indices(masks.shape[1:])
    for mask, edge, changed in zip(masks, edges, discs, strict=True):
        if edge:
            before = mask == (edge > 0)
            mask[1:, 1:][before[:-1, 1:] | before[1:, :-1]] = edge > 0
        for u, v, radius in changed[changed[:, 2] != 0]:
            mask[(x - u) ** 2 + (y - v) ** 2 <= radius**2] = radius < 0


def centre_coverage(masks, grids, corners):
    """Window about the centroid in a wide margin, in blocks of 2 x 2."""
    rows, columns = grids.shape[1:]
    margin = 2 * max(*masks.shape[1:], rows, columns)
    for n, mask in enumerate(masks):
        place = np.argwhere(mask) if mask.any() else np.argwhere(mask == 0)
        middle_y, middle_x = place.mean(0)
        corners[n] = np.floor(
            [middle_x - (2 * columns - 1) / 2 + 0.5, middle_y - (2 * rows - 1) / 2 + 0.5]
        )
        left, top = corners[n] + margin
        window = np.pad(mask, margin)[top : top + 2 * rows, left : left + 2 * columns]
        grids[n] = window.reshape(rows, 2, columns, 2).sum(axis=(1, 3))
