import cv2
import numpy as np

from silhouette_core.image.spans import Spans
from tests.kernel_examples import Example
from tests.kernel_examples.bodies import rotations

SIZE = (12, 17)


def masks(rng, count=4):
    noise = rng.normal(size=(count, *SIZE))
    return np.stack([cv2.GaussianBlur(image, (0, 0), 1.5) > 0 for image in noise])


def centre_windows(rng):
    parts = rng.integers(1, 5, (4, *SIZE), dtype=np.uint8) * masks(rng)
    parts[0], parts[1, :, 5:] = 0, 0
    windows, shifts = np.empty((4, 9, 12), np.uint8), np.empty((4, 2), np.int32)
    return Example((parts, windows, shifts, np.zeros((4, 4), np.uint16), np.empty(4, np.int32)))


def draw_runs(rng):
    spans = Spans.from_masks(masks(rng))
    runs = spans.rows, spans.starts, spans.ends, spans.offsets
    return Example((*runs, np.array([2, 0]), np.zeros((2, *SIZE), bool)))


def nearest_samples(rng):
    bases, views, same_pitch, sources = 10, 6, 3, 8
    orientation = rotations(rng, bases * views).reshape(-1, 9) / np.sqrt(2)
    candidates = np.stack([rng.permutation(bases)[:7] for _ in range(sources)])
    squares = np.sort(rng.uniform(0, 9, (sources, 7)), axis=1)
    given = rng.permutation(bases * views)[:sources], candidates, squares, orientation
    filled = np.empty((sources, 9), np.int32), np.empty((sources, 9), np.float32)
    scales = rng.uniform(0.2, 2, sources), views, same_pitch
    return Example((*given, *scales, *filled), rtol=1e-6)


def thin_rows(rng):
    # Multiples of half the tolerance: many differences are the tolerance exactly.
    rows = 0.5 * rng.integers(-4, 5, (60, 4))
    return Example((rows, np.array([2, 0]), 1.0, np.zeros(60, bool)))
