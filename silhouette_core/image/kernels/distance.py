"""Thinning of silhouettes to their middle lines, for the weights of the silhouette distance.

Source: Guo and Hall, Parallel thinning with two-subiteration algorithms (CACM 1989), algorithm A1.
Reference: `reference.py`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def thin_in_place(image, removable):
    """Thins image (h + 2, w + 2) uint8 of 0 and 1 with an empty rim; removable (2, 256) says which
    neighbourhoods go in each pass.

    A pixel that stayed in both passes is checked again only once a neighbour went: nothing else can
    change the result.
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
    waiting = np.zeros(room, np.uint8)  # how many more passes check a pixel
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
