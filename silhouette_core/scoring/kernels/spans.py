"""Silhouette distances as sums over runs of pixels.

The weighted disagreement of P with Q is the sum of d_P over P plus the sum of d_P (1 - 2 P) over Q:
two look-ups of a prefix sum for every run of Q.

Source: Okada and Stenger, eq. (7)-(9), rearranged. Reference: `tests.oracles.scoring`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def padded_prefix(observation, weights, margin, prefix):
    """Fills prefix (h + 2 m, w + 2 m + 1), sums of d (1 - 2 P) along rows; returns the sum of d P.

    Beyond the window (h, w) d goes on and P is 0.
    """
    height, width = observation.shape
    base = 0.0
    for v in range(prefix.shape[0]):
        y = min(max(v - margin, 0), height - 1)
        within = margin <= v < margin + height
        total = 0.0
        prefix[v, 0] = 0.0
        for u in range(prefix.shape[1] - 1):
            x = min(max(u - margin, 0), width - 1)
            weight = np.float64(weights[y, x])
            if within and margin <= u < margin + width and observation[y, x]:
                base += weight
                total -= weight
            else:
                total += weight
            prefix[v, u + 1] = total
    return base


@kernel
def _sum_runs(flat, width, first, last, rows, starts, ends):
    """Signed weights under the runs first to last, for one combination.

    Unsigned 32-bit indices and a sum each for ends and starts: twice as fast as plain ones.
    """
    to_ends, to_starts = 0.0, 0.0
    for n in range(first, last):
        line = np.uint32(np.uint32(rows[n]) * width)
        to_ends += flat[np.uint32(line + np.uint32(ends[n]))]
        to_starts += flat[np.uint32(line + np.uint32(starts[n]))]
    return to_ends - to_starts


@kernel
def _score(prefixes, shifts, margin, bases, scale, rows, starts, ends, first, last, distances):
    """Fills distances (C,): scale (bases + signed weights under the runs first to last)."""
    width, count = np.uint32(prefixes.shape[2]), len(shifts)
    for c in range(len(bases)):
        shift = shifts[c % count]
        start = (margin + shift[1]) * prefixes.shape[2] + margin + shift[0]
        flat = prefixes[c // count].reshape(-1)[start:]
        total = bases[c] + _sum_runs(flat, width, first, last, rows, starts, ends)
        distances[c] = scale * total


@kernel
def span_distances(
    prefixes, shifts, margin, bases, scale, rows, starts, ends, offsets, which, distances
):
    """Fills distances (K, C) of silhouettes `which` (K,), in combinations of the prefix images
    (P, h + 2 m, w + 2 m + 1) and the shifts (S, 2).
    """
    target, runs = (prefixes, shifts, margin, bases, scale), (rows, starts, ends)
    for k in range(len(which)):
        _score(*target, *runs, offsets[which[k]], offsets[which[k] + 1], distances[k])


@parallel_kernel
def span_distances_parallel(
    prefixes, shifts, margin, bases, scale, rows, starts, ends, offsets, which, distances
):
    """As `span_distances`, in parallel over the silhouettes."""
    target, runs = (prefixes, shifts, margin, bases, scale), (rows, starts, ends)
    for k in prange(len(which)):
        _score(*target, *runs, offsets[which[k]], offsets[which[k] + 1], distances[k])
