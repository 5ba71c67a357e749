"""The kernels of this folder in NumPy, as close to their definitions as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np


def centre_windows(parts, windows, shifts, areas, outside):
    """Shift by whole pixels that brings the centroid nearest to the window's middle."""
    height, width = windows.shape[1:]
    for n, canvas in enumerate(parts):
        rows, columns = np.nonzero(canvas)
        areas[n] = areas[n] + np.bincount(canvas[rows, columns] - 1, minlength=areas.shape[1])
        middle = np.array([width - 1, height - 1]) / 2
        centroid = np.array([columns.mean(), rows.mean()]) if len(rows) else middle - 0.5
        right, down = shifts[n] = np.floor(middle - centroid + 0.5) * (len(rows) > 0)
        u, v = np.arange(width) - int(right), np.arange(height) - int(down)
        inside = np.ix_((v >= 0) & (v < len(canvas)), (u >= 0) & (u < canvas.shape[1]))
        windows[n] = 0
        windows[n][inside] = canvas[np.ix_(v[inside[0].ravel()], u[inside[1].ravel()])]
        outside[n] = len(rows) - np.count_nonzero(windows[n])


def draw_runs(rows, starts, ends, offsets, which, masks):
    """Sum of the steps along each row."""
    steps = np.zeros((*masks.shape[:2], masks.shape[2] + 1), int)
    for n, k in enumerate(which):
        runs = slice(offsets[k], offsets[k + 1])
        np.add.at(steps[n], (rows[runs], starts[runs]), 1)
        np.add.at(steps[n], (rows[runs], ends[runs]), -1)
    masks[:] = steps.cumsum(axis=2)[..., :-1] > 0


def nearest_samples(
    sources, bases, squares, orientation, per_root, views, same_pitch, index, distance2
):
    """Okada and Stenger, eq. (4): squared distances to all candidates, sorted."""
    for n, source in enumerate(sources):
        first = source % views // same_pitch * same_pitch
        other = (bases[n][:, None] * views + first + np.arange(same_pitch)).ravel()
        cosine = (orientation[other] @ orientation[source] - 0.5).clip(-1, 1)
        square = np.repeat(squares[n], same_pitch) + per_root[n] * np.arccos(cosine) ** 2
        square[other == source] = 0
        order = np.argsort(square, kind="stable")[: index.shape[1]]
        index[n], distance2[n] = source, np.inf
        index[n, : len(order)], distance2[n, : len(order)] = other[order], square[order]


def thin_rows(rows, grid, tolerance, kept):
    """Okada and Stenger, section 3: a row goes if a kept one is within the tolerance everywhere."""
    for n, row in enumerate(rows):
        near = (np.abs(row - rows[:n][kept[:n]]) <= tolerance).all(axis=1)
        kept[n] = not near.any()
