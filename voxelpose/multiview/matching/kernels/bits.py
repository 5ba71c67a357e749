"""Counts of voxels in sets that are kept as bits.

Source: Iiyama, Kameda and Minoh, steps (3) and (5), the voxels that several parts cover; the bounds
are this project's. Reference: `reference.py`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def popcount(word):
    """Number of set bits of a uint64 (SWAR)."""
    w = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    w = (w & np.uint64(0x3333333333333333)) + ((w >> np.uint64(2)) & np.uint64(0x3333333333333333))
    w = (w + (w >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (w * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel
def count_new(bits, taken, new):
    """Fills new (K,) with the number of voxels of each row of bits (K, W) not in taken (W,)."""
    for k in range(bits.shape[0]):
        total = np.uint64(0)
        for w in range(bits.shape[1]):
            total += popcount(bits[k, w] & ~taken[w])
        new[k] = total


@kernel
def count_common(first, second):
    """Number of voxels in both sets (W,)."""
    total = np.uint64(0)
    for w in range(first.shape[0]):
        total += popcount(first[w] & second[w])
    return total


@kernel
def find_dominated(bits, gain, dominated):
    """Marks the rows of bits (K, W) to which an earlier one is to be preferred: it earns more by
    what the row has beyond it, or as much.

    With gains gain (K,) and sets A (earlier) and B: whatever is taken, B adds at most |B - A| more
        voxels than A.
    """
    for b in range(1, bits.shape[0]):
        for a in range(b):
            if dominated[a] or gain[a] < gain[b]:
                continue
            ahead = gain[a] - gain[b]
            beyond = 0.0
            for w in range(bits.shape[1]):
                beyond += popcount(bits[b, w] & ~bits[a, w])
                if beyond > ahead:
                    break
            if beyond <= ahead:
                dominated[b] = True
                break
