"""Loops of thinning and of the weighted silhouette distances."""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def thin_in_place(image, removable):
    """Thins image (h + 2, w + 2) uint8 of 0 and 1 with an empty rim; removable (2, 256) says which
    neighbourhoods go in each pass.

    A pixel that stayed in both passes is looked at again only once a neighbour went: nothing else
        can change its lot.
    """
    width = image.shape[1]
    pixels = image.reshape(-1)
    steps = np.array([-width - 1, -width, -width + 1, 1, width + 1, width, width - 1, -1])
    room = pixels.size
    active, following, gone = (
        np.empty(room, np.int32),
        np.empty(room, np.int32),
        np.empty(room, np.int32),
    )
    waiting = np.zeros(room, np.uint8)  # how many more passes look at a pixel
    count = 0
    for p in range(width + 1, room - width - 1):
        if pixels[p]:
            for s in steps:
                if not pixels[p + s]:
                    active[count] = p
                    waiting[p] = 2
                    count += 1
                    break
    turn = 0
    while count:
        lost = 0
        for k in range(count):
            p = active[k]
            code = 0
            for i in range(8):
                code |= np.int64(pixels[p + steps[i]]) << i
            if removable[turn, code]:
                gone[lost] = p
                lost += 1
        for k in range(lost):
            pixels[gone[k]] = 0
        left = 0
        for k in range(count):
            p = active[k]
            waiting[p] -= 1
            if pixels[p] and waiting[p]:
                following[left] = p
                left += 1
        for k in range(lost):
            for s in steps:
                p = gone[k] + s
                if pixels[p]:
                    if waiting[p] == 0:
                        following[left] = p
                        left += 1
                    waiting[p] = 2
        active, following, count = following, active, left
        turn = 1 - turn


@parallel_kernel
def dense_distance(observation, weights, silhouettes, distances):
    """Fills distances (K,): eq. (7), the weights of the pixels where silhouettes (K, h, w) differ
    from the observation (h, w).
    """
    for k in prange(len(distances)):
        total = 0.0
        for y in range(observation.shape[0]):
            for x in range(observation.shape[1]):
                if observation[y, x] != silhouettes[k, y, x]:
                    total += weights[y, x]
        distances[k] = total


@kernel
def padded_prefix(observation, weights, margin, prefix):
    """Fills prefix (h + 2 m, w + 2 m + 1), sums of d (1 - 2 P) along rows; returns the sum of d P.
    Beyond the window d goes on, P is 0.
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
def score_runs(flat, width, first, last, rows, starts, ends, origin):
    """Returns the signed weights under the runs first to last; flat is the prefix image, `width`
    wide, `origin` where the window begins.

    Unsigned 32-bit places and a sum each for ends and starts: twice as fast as the plain
    expression.
    """
    to_ends, to_starts = 0.0, 0.0
    for n in range(first, last):
        line = np.uint32(np.uint32(rows[n]) * width + origin)
        to_ends += flat[np.uint32(line + np.uint32(ends[n]))]
        to_starts += flat[np.uint32(line + np.uint32(starts[n]))]
    return to_ends - to_starts


@kernel
def span_distance(flat, width, base, scale, rows, starts, ends, offsets, which, origins, distances):
    """Fills distances (S, K): scale (base + signed weights under the runs) of silhouettes `which`
    (K,), for windows at `origins` (S,).
    """
    for k in range(len(which)):
        first, last = offsets[which[k]], offsets[which[k] + 1]
        for s in range(len(origins)):
            distances[s, k] = scale * (
                base + score_runs(flat, width, first, last, rows, starts, ends, origins[s])
            )


@parallel_kernel
def span_distance_parallel(
    flat, width, base, scale, rows, starts, ends, offsets, which, origins, distances
):
    """As `span_distance`, in parallel over the silhouettes."""
    for k in prange(len(which)):
        first, last = offsets[which[k]], offsets[which[k] + 1]
        for s in range(len(origins)):
            distances[s, k] = scale * (
                base + score_runs(flat, width, first, last, rows, starts, ends, origins[s])
            )
