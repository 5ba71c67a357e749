"""Drawn silhouettes against an observed one.

Source: Okada and Stenger, eq. (7)-(9), rearranged. Reference: `tests.oracles.scoring`.
"""

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def sum_weights(parts, weights, totals):
    """Fills totals (K,): the weights (h, w) where each image of parts (K, h, w) is not 0.

    With weights d_P (1 - 2 P): Okada and Stenger, eq. (7)-(9), rearranged.
    """
    for k in prange(len(totals)):
        total = 0.0
        for i in range(weights.shape[0]):
            drawn = np.uint8(0)  # most rows of a limb's image are empty
            for j in range(weights.shape[1]):
                drawn |= parts[k, i, j]
            if drawn:
                for j in range(weights.shape[1]):
                    if parts[k, i, j] != 0:
                        total += weights[i, j]
        totals[k] = total


@kernel
def count_disagreement(parts, mask):
    """Numbers of pixels |P xor Q| and |P or Q| for mask P (h, w) and the part image of Q, of at
    least that size.
    """
    apart, either = 0, 0
    for i in range(mask.shape[0]):
        for j in range(mask.shape[1]):
            drawn = parts[i, j] != 0
            apart += drawn ^ mask[i, j]
            either += drawn | mask[i, j]
    return apart, either
