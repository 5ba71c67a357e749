"""Moments of a recording, evenly spread."""

import numpy as np
from numpy.typing import NDArray

from calib.tuning import AGREEMENT


def even_moments(count: int, most: int, margin: float = AGREEMENT.ends) -> NDArray[np.int64]:
    """At most `most` of `count` frame numbers, evenly spaced.

    Args:
        margin: Fraction of the frames left out at either end, where people come and go.
    """
    first, last = margin * (count - 1), (1 - margin) * (count - 1)
    return np.unique(np.linspace(first, last, min(most, count)).round().astype(np.int64))
