import numpy as np

from silhouette_core.image.spans import Spans
from tests.kernel_examples import Example
from tests.kernel_examples.bodies import rotations

SIZE = (14, 22)


def observed(rng):
    return rng.random(SIZE) > 0.5, rng.random(SIZE).astype(np.float32)


def padded_prefix(rng):
    return Example((*observed(rng), 2, np.empty((SIZE[0] + 4, SIZE[1] + 5))), rtol=1e-12)


def span_distances(rng):
    spans = Spans.from_masks([rng.random(SIZE) > 0.6 for _ in range(9)])
    runs = (one.astype(np.int16) for one in (spans.rows, spans.starts, spans.ends))
    prefixes = rng.normal(size=(2, SIZE[0] + 4, SIZE[1] + 5))
    moved = prefixes, rng.integers(-2, 3, (3, 2)), 2, rng.normal(size=6), 0.3
    which, filled = rng.integers(0, 9, 7), np.empty((7, 6))
    return Example((*moved, *runs, spans.offsets, which, filled), rtol=1e-9, atol=1e-12)


span_distances_parallel = span_distances


def placements(rng):
    return rng.normal(size=(40, 3)), rotations(rng, 8), rng.normal(size=(8, 3))


def pixel_scores(rng):
    cameras = rng.uniform(5, 20, (3, 4)), rotations(rng, 3), rng.normal(0.5, 1, (3, 3))
    images = rng.integers(-3, 3, (3, *SIZE)).astype(np.int8)
    return Example((*placements(rng), *cameras, images, np.empty(8, np.int64)))


def corner():
    """Origin of a grid, which nobody writes, as that of a `VoxelGrid`."""
    origin = np.full(3, -1.0)
    origin.setflags(write=False)
    return origin


def voxel_overlap(rng):
    points, *placed = placements(rng)
    cells = rng.random((9, 10, 11)) > 0.4, corner(), 5.0
    return Example((*cells, points, rng.random(40), *placed, *np.empty((2, 8))))


def voxel_cover(rng):
    numbers = np.arange(990, dtype=np.int32).reshape(9, 10, 11)
    numbers[rng.random(numbers.shape) < 0.4] = -1
    numbers[rng.random(numbers.shape) < 0.2] = -2
    filled = np.empty((8, 16), np.uint64), *np.empty((2, 8), np.int64)
    return Example((numbers, corner(), 5.0, *placements(rng), *filled))
