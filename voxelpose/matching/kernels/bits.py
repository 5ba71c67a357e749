"""Sets of voxels as bits: which voxels a placed limb covers, and how many of them are new."""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def cover(ids, origin, voxel_size, points, rotations, translations, bits, empty, inside):
    """Marks the voxels that each placement covers.

    ids (nx, ny, nz) int32 numbers the voxels that are still free, -1 is empty space and -2 belongs
    to a part already placed. Fills bits (K, W) uint64, empty (K,), the number of points in empty
    space or outside the grid, and inside (K,), those in parts already placed.
    """
    nx, ny, nz = ids.shape
    for k in prange(rotations.shape[0]):
        r, t = rotations[k], translations[k]
        missed, shared = 0, 0
        for w in range(bits.shape[1]):
            bits[k, w] = np.uint64(0)
        for p in range(points.shape[0]):
            x, y, z = points[p, 0], points[p, 1], points[p, 2]
            i = int(
                np.floor((r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + t[0] - origin[0]) / voxel_size)
            )
            j = int(
                np.floor((r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + t[1] - origin[1]) / voxel_size)
            )
            m = int(
                np.floor((r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + t[2] - origin[2]) / voxel_size)
            )
            if i < 0 or j < 0 or m < 0 or i >= nx or j >= ny or m >= nz:
                missed += 1
                continue
            voxel = ids[i, j, m]
            if voxel >= 0:
                bits[k, voxel >> 6] |= np.uint64(1) << np.uint64(voxel & 63)
            elif voxel == -1:
                missed += 1
            else:
                shared += 1
        empty[k] = missed
        inside[k] = shared


@kernel
def popcount(word):
    """Number of set bits of a uint64 (SWAR)."""
    w = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    w = (w & np.uint64(0x3333333333333333)) + ((w >> np.uint64(2)) & np.uint64(0x3333333333333333))
    w = (w + (w >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (w * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel
def count_new(bits, taken, new):
    """Fills new (K,) with the number of voxels of each row of bits (K, W) that are not in taken
    (W,).
    """
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
