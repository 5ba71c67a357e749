"""Numbers by which candidates are ranked, free of the order of sums: the last digits, which differ
with backend, processor and threads, would choose between equal ones.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.checks import FloatArray, RealArray

_DECIMALS = 6  # one pixel of a silhouette of 250,000 in four cameras
_BITS = 45  # of 53: sums over runs of pixels reach many times that of all weights


def rounded(costs: ArrayLike) -> FloatArray:
    """Costs, nats or shares, of any shape, to six decimals: less means nothing. Of equal candidates
    the first is taken.
    """
    return np.round(np.asarray(costs, np.float64), _DECIMALS)


def summable(weights: RealArray) -> NDArray[Any]:
    """Weights of any shape, whose sums are exact in any order: multiples of one power of two, a
    2^45th of what the sum of all can be.
    """
    largest = float(np.abs(weights).max(initial=0))
    exponent = int(np.frexp(largest)[1]) + weights.size.bit_length() - _BITS
    return np.ldexp(np.rint(np.ldexp(weights, -exponent)), exponent)
