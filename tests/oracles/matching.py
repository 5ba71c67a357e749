"""The kernels of this folder in NumPy, as close to their equations as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np


def popcount(word):
    """Number of set bits."""
    return np.bitwise_count(word)


def count_new(bits, taken, new):
    """|A_k - T| for every set A_k."""
    new[:] = np.bitwise_count(bits & ~taken).sum(axis=1)


def count_common(first, second):
    """|A and B|."""
    return np.bitwise_count(first & second).sum()


def find_dominated(bits, gain, dominated):
    """B falls to an earlier A that stands where |B - A| <= gain_A - gain_B."""
    for b in range(1, len(bits)):
        beyond = np.bitwise_count(bits[b] & ~bits[:b]).sum(axis=1)
        dominated[b] = (~dominated[:b] & (beyond <= gain[:b] - gain[b])).any()
