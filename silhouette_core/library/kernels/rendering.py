"""Loops from part images to windows, areas and runs."""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def turn_and_place(posed, pelvis, rotations, distance, placed):
    """Fills placed (N, V, 3): posed (N, V, 3) turned by rotations (N, 3, 3) about pelvis (N, 3),
    which comes to (0, 0, distance).
    """
    for n in prange(len(posed)):
        r, o = rotations[n], pelvis[n]
        for v in range(posed.shape[1]):
            x, y, z = posed[n, v, 0] - o[0], posed[n, v, 1] - o[1], posed[n, v, 2] - o[2]
            for i in range(3):
                placed[n, v, i] = r[i, 0] * x + r[i, 1] * y + r[i, 2] * z
            placed[n, v, 2] += distance


@parallel_kernel
def centre(parts, windows, shifts, areas, outside):
    """Cuts windows (N, h, w) out of part images (N, H, W), the silhouette's centroid in the middle.

    Fills shifts (N, 2), how far (right, down) the canvas moved; areas (N, P), pixels of each part
    in the whole canvas; outside (N,), pixels that the window cuts off.
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
        kept = 0
        for y in range(height):
            for x in range(width):
                u, v = x - right, y - down
                label = parts[n, v, u] if 0 <= v < parts.shape[1] and 0 <= u < parts.shape[2] else 0
                windows[n, y, x] = label
                kept += label != 0
        outside[n] = count - kept


@kernel
def count_runs(mask):
    """Returns the number of runs of a mask (h, w)."""
    count = 0
    for y in range(mask.shape[0]):
        before = False
        for x in range(mask.shape[1]):
            count += mask[y, x] and not before
            before = mask[y, x]
    return count


@parallel_kernel
def count_all_runs(masks, counts):
    """Fills counts (N,) for masks (N, h, w)."""
    for n in prange(len(masks)):
        counts[n] = count_runs(masks[n])


@parallel_kernel
def fill_runs(masks, offsets, rows, starts, ends):
    """Fills the runs of masks (N, h, w), those of mask n from offsets[n] on."""
    width = masks.shape[2]
    for n in prange(len(masks)):
        k = offsets[n]
        for y in range(masks.shape[1]):
            before = False
            for x in range(width):
                now = masks[n, y, x]
                if now and not before:
                    rows[k], starts[k] = y, x
                elif before and not now:
                    ends[k] = x
                    k += 1
                before = now
            if before:
                ends[k] = width
                k += 1


@kernel
def draw_runs(rows, starts, ends, offsets, which, masks):
    """Draws silhouettes `which` (N,) into empty masks (N, h, w)."""
    for n in range(len(which)):
        for k in range(offsets[which[n]], offsets[which[n] + 1]):
            masks[n, rows[k], starts[k] : ends[k]] = True
