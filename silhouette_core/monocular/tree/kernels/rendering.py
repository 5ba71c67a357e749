"""From part images to windows, areas and runs.

Source: own. Reference: `tests.oracles.tree`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def centre_windows(parts, windows, shifts, areas, outside):
    """Fills windows (N, h, w) from part images (N, H, W), the silhouette's centroid in the middle.

    Also fills shifts (N, 2), by which the image was moved (right, down), px; areas (N, P), pixels
    of each part in the whole image; outside (N,), pixels that the window cuts off.
    """
    height, width = windows.shape[1], windows.shape[2]
    for n in prange(len(parts)):
        count, sum_x, sum_y = 0, 0, 0
        for y in range(parts.shape[1]):
            for x in range(parts.shape[2]):
                label = parts[n, y, x]
                if label:
                    areas[n, label - 1] += 1
                    count += 1
                    sum_x += x
                    sum_y += y
        right, down = 0, 0
        if count:
            right = np.int64(np.floor((width - 1) / 2 - sum_x / count + 0.5))
            down = np.int64(np.floor((height - 1) / 2 - sum_y / count + 0.5))
        shifts[n, 0], shifts[n, 1] = right, down
        covered = 0
        for y in range(height):
            for x in range(width):
                u, v = x - right, y - down
                label = parts[n, v, u] if 0 <= v < parts.shape[1] and 0 <= u < parts.shape[2] else 0
                windows[n, y, x] = label
                covered += label != 0
        outside[n] = count - covered


@kernel
def draw_runs(rows, starts, ends, offsets, which, masks):
    """Draws the runs of silhouettes `which` (N,) into empty masks (N, h, w)."""
    for n in range(len(which)):
        for k in range(offsets[which[n]], offsets[which[n] + 1]):
            masks[n, rows[k], starts[k] : ends[k]] = True
