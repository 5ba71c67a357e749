"""Poses that are near to each other: greedy thinning with a hash grid, and nearest samples.

Source: Okada and Stenger, section 3, criterion of the thinning, and eq. (4) and (5), whose squared
distances are compared; the searches are ours, with the hash of Fowler, Noll and Vo (FNV-1a).
Reference: `tests.oracles.tree`, of the thinning pair by pair.
"""

import math

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def _bucket(cell, mask):
    """Bucket of a cell, from its integer coordinates (FNV-1a, then a final shuffle)."""
    key = np.uint64(14695981039346656037)
    for k in range(cell.shape[0]):
        key = (key ^ np.uint64(cell[k])) * np.uint64(1099511628211)
    return np.int64((key ^ (key >> np.uint64(29))) & mask)


@kernel
def thin_rows(rows, grid, tolerance, kept):
    """Fills kept (N,): whether no earlier kept row of rows (N, K) is as near in every column.

    The grid is over the columns `grid` (G,), its cells twice the tolerance wide, so that the
    neighbourhood of a row touches at most two cells a column, 2^G in all. Kept rows of a bucket
    form a linked list; other cells that share the bucket cost a comparison each.
    """
    size = 16
    while size < 2 * rows.shape[0]:
        size *= 2
    mask = np.uint64(size - 1)
    head = np.full(size, -1, np.int64)
    following = np.full(rows.shape[0], -1, np.int64)
    dimensions = grid.shape[0]
    cells = np.empty((3, dimensions), np.int64)
    cell, low, high = cells[0], cells[1], cells[2]
    width = 2.001 * tolerance
    reach = 1.0001 * tolerance  # a little more than needed, so that rounding hides no neighbour
    for n in range(rows.shape[0]):
        for g in range(dimensions):
            x = rows[n, grid[g]]
            low[g] = np.int64(np.floor((x - reach) / width))
            high[g] = np.int64(np.floor((x + reach) / width))
        free = True
        corner = 0
        while free and corner < 1 << dimensions:
            new = True  # where low and high agree, the corners of that column are the same cell
            for g in range(dimensions):
                up = (corner >> g) & 1
                new = new and (up == 0 or low[g] != high[g])
                cell[g] = high[g] if up else low[g]
            other = head[_bucket(cell, mask)] if new else -1
            while other >= 0 and free:
                near = True
                k = 0
                while near and k < rows.shape[1]:
                    near = abs(rows[n, k] - rows[other, k]) <= tolerance
                    k += 1
                free = not near
                other = following[other]
            corner += 1
        kept[n] = free
        if free:
            for g in range(dimensions):
                cell[g] = np.int64(np.floor(rows[n, grid[g]] / width))
            bucket = _bucket(cell, mask)
            following[n] = head[bucket]
            head[bucket] = n


@parallel_kernel
def nearest_samples(
    sources, bases, squares, orientation, per_root, views, same_pitch, index, distance2
):
    """Fills index (n, K) and distance2 (n, K): the samples nearest to each source, nearest first,
    and their squared distances in sigmas.

    Candidates are base poses (n, C) in order of their joints' squared distance (n, C); that of the
    orientation, times per_root (n,), is added for every view of the source's pitch. Of samples at
    the same distance the first is kept.
    """
    for n in prange(len(sources)):
        source = sources[n]
        view = source % views
        first = view - view % same_pitch
        filled = 0
        room = index.shape[1]
        for c in range(bases.shape[1]):
            joints = squares[n, c]
            if filled == room and joints >= distance2[n, room - 1]:
                break
            for v in range(first, first + same_pitch):
                other = bases[n, c] * views + v
                cosine = -0.5
                for i in range(9):
                    cosine += np.float64(orientation[source, i]) * orientation[other, i]
                angle = math.acos(min(1.0, max(-1.0, cosine)))
                square = joints + per_root[n] * angle * angle
                if other == source:
                    square = 0.0
                if filled == room and square >= distance2[n, room - 1]:
                    continue
                k = filled if filled < room else room - 1
                filled = min(filled + 1, room)
                while k > 0 and distance2[n, k - 1] > square:
                    distance2[n, k], index[n, k] = distance2[n, k - 1], index[n, k - 1]
                    k -= 1
                distance2[n, k], index[n, k] = square, other
        for k in range(filled, room):
            index[n, k], distance2[n, k] = source, np.inf
