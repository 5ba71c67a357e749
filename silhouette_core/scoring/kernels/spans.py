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


@parallel_kernel
def interleave(prefixes, shifts, margin, table):
    """Fills table (h, w + 1, P S): entry p S + s is prefix image p (P, h + 2 m, w + 2 m + 1) moved
    by shift s (S, 2).
    """
    count = len(shifts)
    for y in prange(table.shape[0]):
        for p in range(len(prefixes)):
            for s in range(count):
                line = prefixes[p, y + margin + shifts[s, 1]]
                first = margin + shifts[s, 0]
                for x in range(table.shape[1]):
                    table[y, x, p * count + s] = line[first + x]


@kernel
def _sum_runs(flat, width, first, last, rows, starts, ends):
    """Signed weights under the runs first to last, for one combination.

    Unsigned 32-bit indices and a sum each for ends and starts: twice as fast as the plain
    expression.
    """
    to_ends, to_starts = 0.0, 0.0
    for n in range(first, last):
        line = np.uint32(np.uint32(rows[n]) * width)
        to_ends += flat[np.uint32(line + np.uint32(ends[n]))]
        to_starts += flat[np.uint32(line + np.uint32(starts[n]))]
    return to_ends - to_starts


@kernel
def _score_all(flat, width, bases, scale, first, last, rows, starts, ends, distances):
    """Fills distances (C,), all combinations by a few vector instructions."""
    room = len(bases)
    to_ends, to_starts = np.zeros(room), np.zeros(room)
    for n in range(first, last):
        line = np.int64(rows[n]) * width
        end = flat[(line + ends[n]) * room : (line + ends[n] + 1) * room]
        start = flat[(line + starts[n]) * room : (line + starts[n] + 1) * room]
        for c in range(room):
            to_ends[c] += end[c]
            to_starts[c] += start[c]
    for c in range(room):
        distances[c] = scale * (bases[c] + (to_ends[c] - to_starts[c]))


@kernel
def span_distances(flat, width, bases, scale, rows, starts, ends, offsets, which, distances):
    """Fills distances (K, C): scale (bases + signed weights under the runs) of silhouettes `which`
    (K,); flat is the table of prefix sums (h, width, C).
    """
    narrow, base = np.uint32(width), bases[0]
    if len(bases) == 1:
        for k in range(len(which)):
            first, last = offsets[which[k]], offsets[which[k] + 1]
            total = base + _sum_runs(flat, narrow, first, last, rows, starts, ends)
            distances[k, 0] = scale * total
    else:
        for k in range(len(which)):
            first, last = offsets[which[k]], offsets[which[k] + 1]
            _score_all(flat, width, bases, scale, first, last, rows, starts, ends, distances[k])


@parallel_kernel
def span_distances_parallel(
    flat, width, bases, scale, rows, starts, ends, offsets, which, distances
):
    """As `span_distances`, in parallel over the silhouettes."""
    narrow, base = np.uint32(width), bases[0]
    if len(bases) == 1:
        for k in prange(len(which)):
            first, last = offsets[which[k]], offsets[which[k] + 1]
            total = base + _sum_runs(flat, narrow, first, last, rows, starts, ends)
            distances[k, 0] = scale * total
    else:
        for k in prange(len(which)):
            first, last = offsets[which[k]], offsets[which[k] + 1]
            _score_all(flat, width, bases, scale, first, last, rows, starts, ends, distances[k])


@parallel_kernel
def moved_span_distances(
    prefixes, shifts, margin, bases, scale, rows, starts, ends, offsets, which, distances
):
    """As `span_distances`, from prefix images (P, h + 2 m, w + 2 m + 1) and shifts (S, 2) that were
    not interleaved: for few silhouettes.
    """
    width, count = np.uint32(prefixes.shape[2]), len(shifts)
    for k in prange(len(which)):
        first, last = offsets[which[k]], offsets[which[k] + 1]
        for c in range(len(bases)):
            shift = shifts[c % count]
            start = (margin + shift[1]) * prefixes.shape[2] + margin + shift[0]
            flat = prefixes[c // count].reshape(-1)[start:]
            total = bases[c] + _sum_runs(flat, width, first, last, rows, starts, ends)
            distances[k, c] = scale * total
