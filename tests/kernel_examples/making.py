import numpy as np

from tests.kernel_examples import Example
from tests.kernel_examples.tree import masks


def spoil_silhouettes(rng):
    discs = np.concatenate([rng.uniform(-3, 18, (6, 3, 2)), rng.uniform(-2, 5, (6, 3, 1))], axis=2)
    edges = np.array([-1, 0, 1, -1, 0, 1], np.int8)
    return Example((masks(rng, 6).astype(np.uint8), edges, discs))


def centre_coverage(rng):
    given = masks(rng).astype(np.uint8)
    given[0], given[1, :, 5:], given[2, :9] = 0, 0, 0
    return Example((given, np.empty((4, 3, 5), np.uint8), np.empty((4, 2), np.int32)))
