import numpy as np

from tests.kernel_examples import Example
from tests.kernel_examples.tree import masks


def thin_rows(rng):
    # Multiples of half the tolerance: many differences are the tolerance exactly.
    rows = 0.5 * rng.integers(-4, 5, (60, 4))
    return Example((rows, np.array([2, 0]), 1.0, np.zeros(60, bool)))


def spoil_silhouettes(rng):
    discs = np.concatenate([rng.uniform(-3, 18, (6, 3, 2)), rng.uniform(-2, 5, (6, 3, 1))], axis=2)
    edges = np.array([-1, 0, 1, -1, 0, 1], np.int8)
    return Example((masks(rng, 6).astype(np.uint8), edges, discs))


def centre_coverage(rng):
    given = masks(rng).astype(np.uint8)
    given[0], given[1, :, 5:], given[2, :9] = 0, 0, 0
    return Example((given, np.empty((4, 3, 5), np.uint8), np.empty((4, 2), np.int32)))
