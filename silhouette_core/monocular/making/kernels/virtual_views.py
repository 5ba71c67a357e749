"""From drawn silhouettes to centred grids of coverage, with the defects of real silhouettes.

Source: own. Reference: `tests.oracles.making`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def spoil_silhouettes(masks, edges, discs):
    """Changes silhouettes masks (N, H, W) uint8, 0 or 1, in place.

    Where edges (N,) is 1, the silhouette grows by a pixel to the right and down, where it is -1 it
    shrinks from the left and from above; the image's first row and column stay. Discs (N, D, 3) of
    x, y and radius, px, are then erased in turn, or made foreground where the radius is negative.
    """
    height, width = masks.shape[1], masks.shape[2]
    for n in range(len(masks)):
        if edges[n] != 0:
            label = np.uint8(edges[n] > 0)
            before = masks[n].copy()
            for y in range(1, height):
                for x in range(1, width):
                    if before[y - 1, x] == label or before[y, x - 1] == label:
                        masks[n, y, x] = label
        for d in range(discs.shape[1]):
            u, v, radius = discs[n, d, 0], discs[n, d, 1], abs(discs[n, d, 2])
            if radius == 0:
                continue
            label = np.uint8(discs[n, d, 2] < 0)
            top, bottom = max(np.int64(v - radius), 0), min(np.int64(v + radius) + 1, height - 1)
            left, right = max(np.int64(u - radius), 0), min(np.int64(u + radius) + 1, width - 1)
            for y in range(top, bottom + 1):
                for x in range(left, right + 1):
                    if (x - u) ** 2 + (y - v) ** 2 <= radius**2:
                        masks[n, y, x] = label


@kernel
def centre_coverage(masks, grids, corners):
    """Fills grids (N, h, w) uint8 from silhouettes masks (N, H, W) uint8, 0 or 1.

    Each cell counts the foreground of 2 x 2 pixels of a window of 2h x 2w pixels, whose middle is
    at the silhouette's centroid, rounded to whole pixels; corners (N, 2) is the window's first
    pixel (x, y). An empty silhouette is taken at the middle of the image.
    """
    rows, columns = grids.shape[1], grids.shape[2]
    for n in range(len(masks)):
        height, width = masks.shape[1], masks.shape[2]
        count, sum_x, sum_y = 0, 0, 0
        for y in range(height):
            for x in range(width):
                if masks[n, y, x]:
                    count += 1
                    sum_x += x
                    sum_y += y
        middle_x, middle_y = (width - 1) / 2, (height - 1) / 2
        if count:
            middle_x, middle_y = sum_x / count, sum_y / count
        left = np.int64(np.floor(middle_x - (2 * columns - 1) / 2 + 0.5))
        top = np.int64(np.floor(middle_y - (2 * rows - 1) / 2 + 0.5))
        corners[n, 0], corners[n, 1] = left, top
        grids[n] = 0
        for y in range(max(top, 0), min(top + 2 * rows, height)):
            for x in range(max(left, 0), min(left + 2 * columns, width)):
                if masks[n, y, x]:
                    grids[n, (y - top) // 2, (x - left) // 2] += 1
