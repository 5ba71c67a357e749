import cv2
import numpy as np
from scipy.spatial import ConvexHull

from silhouette_core.image.distance import _removable
from tests.kernel_examples import Example

SIZE = (20, 30)


def frame(rng):
    return rng.integers(1, 250, (*SIZE, 3), dtype=np.uint8)


def blob(rng, size=SIZE):
    return cv2.GaussianBlur(rng.normal(size=size), (0, 0), 2) > 0


def scene(rng):
    """Frame, background and its noise figures, channel by channel."""
    mean = rng.uniform(20, 240, (3, *SIZE)).astype(np.float32)
    length, noise = np.linalg.norm(mean, axis=0), rng.uniform(1, 3, SIZE)
    scales = np.stack([1 / length**2, 1 / noise, length / noise]).astype(np.float32)
    return np.ascontiguousarray(frame(rng).transpose(2, 0, 1)), mean, scales


def paper_mask(rng):
    image = frame(rng)
    mean = (image + rng.normal(0, 40, image.shape) * blob(rng)[..., None]).astype(np.float32)
    unit = mean / np.linalg.norm(mean, axis=2, keepdims=True)
    variance = rng.uniform(1e-4, 1e-3, mean.shape)
    peak = -0.5 * np.log(2 * np.pi * variance).sum(axis=2)
    limits = np.float32(-30), np.float32(90)
    half_precision = (0.5 / variance).astype(np.float32)
    mask = np.empty(SIZE, bool)
    return Example((image, mean, unit, half_precision, peak.astype(np.float32), *limits, mask))


def median(rng):
    stack = rng.integers(0, 256, (rng.integers(1, 9), *SIZE, 3), dtype=np.uint8)
    return Example((stack, np.empty((*SIZE, 3), np.float32)))


def colour_modes(rng):
    samples = rng.choice([40.0, 45.0, 120.0, 200.0], (9, 30, 1)) + rng.normal(0, 2, (9, 30, 3))
    filled = (np.empty((30, 4, 3), np.float32), np.empty((30, 4), np.float32))
    filled = (*filled, np.empty((30, 4), np.uint64))
    return Example((samples.astype(np.float32), np.float32(15), *filled), rtol=1e-4)


def step_costs(rng):
    mean = rng.choice([40.0, 60.0, 120.0, 200.0], (5, 6, 3, 1)) + rng.normal(0, 3, (5, 6, 3, 3))
    share = rng.choice([0, 0.3, 0.6], mean.shape[:3]).astype(np.float32)
    limits = np.float32(15), np.float32(0.1), np.float32(0.4)
    filled = np.zeros((5, 6, 4, 4), np.float32), np.zeros((5, 6, 4, 4), np.float32)
    return Example((mean.astype(np.float32), share, *limits, *filled), rtol=1e-4)


def least_cost_labels(rng):
    own = rng.uniform(0, 1, (5, 6, 3)).astype(np.float32)
    right, down = (rng.uniform(0, 0.5, (5, 6, 3, 3)).astype(np.float32) for _ in range(2))
    return Example((own, right, down, 3, np.empty((5, 6), np.int64)))


def contrast(rng):
    mean = rng.uniform(20, 240, (*SIZE, 3)).astype(np.float32)
    return Example((frame(rng), mean, blob(rng), np.empty((2, *SIZE), np.float32)), 1e-4, 1e-3)


def pass_on(rng):
    odds = rng.normal(0, 2, (6, 8)).astype(np.float32)
    links = rng.uniform(0, 2, (6, 8)).astype(np.float32)
    return Example((odds, links, rng.normal(0, 1, (2, 6, 8)).astype(np.float32)), 1e-5, 1e-5)


def sampled_chroma(rng):
    return Example((*scene(rng), np.float32(30), 2, 4, np.empty((5, 8), np.float32)), rtol=1e-4)


def residuals(rng):
    limits = np.float32(100), np.float32(30)
    # Rounding may cut to another whole number.
    return Example((*scene(rng), *limits, np.empty((3, *SIZE), np.int16)), atol=1)


def brightness(rng):
    return Example((*scene(rng), np.empty(SIZE, np.float32)), rtol=1e-4, atol=1e-4)


def log_odds(rng):
    """A third of the pixels are the background's, a third are in a shadow."""
    mean = rng.uniform(20, 240, (3, *SIZE)).astype(np.float32)
    noise = rng.uniform(1, 4, SIZE).astype(np.float32)
    length = np.linalg.norm(mean, axis=0)
    scales = np.stack([1 / length**2, 1 / noise, length / noise]).astype(np.float32)
    light = np.choose(rng.integers(3, size=SIZE), [np.ones(SIZE), rng.uniform(0.3, 1, SIZE), 2.0])
    seen = mean * light + rng.normal(0, 2, mean.shape)
    planes = np.clip(np.rint(seen), 0, 255).astype(np.uint8)
    table = rng.uniform(-18, -8, (32, 32, 32)).astype(np.float32)
    others = np.exp(rng.uniform(-18, -8, table.shape)).astype(np.float32)
    shades = rng.uniform(0, 1, 50).astype(np.float32)
    tables = (
        np.float32(1.5),
        np.float32(0.05),
        shades,
        rng.uniform(-5, 5, SIZE).astype(np.float32),
        np.float32(4),
        (table, others, rng.uniform(0, 1, table.shape).astype(np.float32)),
        3,
    )
    filled = blob(rng), np.empty(SIZE, np.float32)
    return Example((planes, mean, scales, *tables, *filled), 1e-3)


def sharpen(rng):
    mask = blob(rng)
    around = (cv2.dilate(mask.view(np.uint8), None) > 0) & ~(
        cv2.erode(mask.view(np.uint8), None) > 0
    )
    planes = np.ascontiguousarray(frame(rng).transpose(2, 0, 1))
    mean = rng.uniform(20, 240, (3, *SIZE)).astype(np.float32)
    light = np.float32(0.2), np.float32(2)
    regions = around, mask & ~around, ~around  # what is inside is not outside
    return Example((planes, mean, light, *regions, 4, np.float32(10), mask.copy()))


def mesh(rng, *poses):
    """Two overlapping convex bodies in front of a camera: what the renderers take first."""
    corners = rng.normal(size=(2, 15, 3))
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    faces = [ConvexHull(body).simplices + 15 * k for k, body in enumerate(corners)]
    part = np.repeat([0, 1], [len(f) for f in faces]).astype(np.int32)
    vertices = (corners + np.array([[[-0.4, 0, 4]], [[0.4, 0.2, 4.3]]])).reshape(30, 3)
    moved = vertices + 0.2 * rng.normal(size=(*poses, 1, 3)) if poses else vertices
    matrix = np.array([[40.0, 0, 29.3], [0, 40, 20.1], [0, 0, 1]])
    return moved, np.concatenate(faces).astype(np.int32), part, matrix, 0.05


def draw(rng):
    filled = np.zeros((40, 60), np.uint8), np.full((40, 60), np.inf, np.float32)
    return Example((*mesh(rng), bool(rng.random() < 0.5), *filled), rtol=1e-5)


def draw_many(rng):
    moved, faces, part, *rest = mesh(rng, 3)
    each = np.stack([part, part + 3, 5 - part]) if rng.random() < 0.5 else part[None]
    return Example((moved, faces, each, *rest, False, np.zeros((3, 40, 60), np.uint8)))


def thin_in_place(rng):
    image = np.pad(blob(rng, (40, 50)).astype(np.uint8), 1)
    return Example((image, _removable()))
