"""Silhouette distances for many windows and shifts at once."""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def interleave(prefixes, shifts, margin, table):
    """Fills table (h, w + 1, C): what every combination of prefix image (P, h + 2 m, w + 2 m + 1)
    and shift (S, 2) holds at a place.

    Combination c is image c // S moved by shift c % S.
    """
    count = len(shifts)
    for y in range(table.shape[0]):
        for p in range(len(prefixes)):
            for s in range(count):
                line = prefixes[p, y + margin + shifts[s, 1]]
                first = margin + shifts[s, 0]
                for x in range(table.shape[1]):
                    table[y, x, p * count + s] = line[first + x]


@parallel_kernel
def shifted_distances(table, bases, rows, starts, ends, offsets, which, distances):
    """Fills distances (K, C): bases (C,) + the signed weights under the runs of silhouettes `which`
    (K,), for every combination.

    The combinations lie next to each other, so that one run is looked up for all of them by a few
    vector instructions.
    """
    width, room = table.shape[1], table.shape[2]
    flat = table.reshape(-1)
    for k in prange(len(which)):
        to_ends, to_starts = np.zeros(room), np.zeros(room)
        for n in range(offsets[which[k]], offsets[which[k] + 1]):
            line = np.int64(rows[n]) * width
            end = flat[(line + ends[n]) * room : (line + ends[n] + 1) * room]
            start = flat[(line + starts[n]) * room : (line + starts[n] + 1) * room]
            for c in range(room):
                to_ends[c] += end[c]
                to_starts[c] += start[c]
        for c in range(room):
            distances[k, c] = bases[c] + (to_ends[c] - to_starts[c])
