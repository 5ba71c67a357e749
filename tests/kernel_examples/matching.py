import numpy as np

from tests.kernel_examples import Example


def sets(rng, *shape):
    return rng.integers(0, 2**64, shape, dtype=np.uint64)


def popcount(rng):
    return Example((sets(rng, 1)[0],))


def count_new(rng):
    return Example((sets(rng, 9, 3), sets(rng, 3), np.empty(9, np.int64)))


def count_common(rng):
    return Example((sets(rng, 3), sets(rng, 3)))


def find_dominated(rng):
    few = rng.integers(0, 2**10, (30, 1)).astype(np.uint64)
    return Example((few, rng.integers(-5, 5, 30).astype(float), np.zeros(30, bool)))
