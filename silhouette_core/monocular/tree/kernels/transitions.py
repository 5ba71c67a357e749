"""Nearest samples in pose space.

Source: Okada and Stenger, eq. (4) and (5), whose squared distances are compared; the search among
candidates is ours. Reference: `tests.oracles.tree`.
"""

import math

import numpy as np

from silhouette_core.jit import parallel_kernel, prange


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
