"""A uniform backdrop, known at the rim of the picture and continued behind whoever stays before it.

A screen, plain or lit unevenly, is one smooth colour field: a polynomial of the position in each
channel. The rim shows no person, mostly, so there the field is fitted first; a floor before the
screen may be a second one. A backdrop is uniform where fields explain most of the rim, and most of
what somebody moves before shows them at other times.

It tells `image.empty_scene` which colours are the scene's and which the person's: of a piece in
which something moves, what no field explains. What does not move at all is a thing of the scene,
and so is what always reaches the border but below, as a panel does.
This project's own.
"""

import cv2
import numpy as np

from calib.checks import BoolArray, Float32Array, FloatArray, IntArray, RealArray
from silhouette_core.image.cleanup import bounding_box, opened, pieces_with
from silhouette_core.tuning import BACKDROP, EXPOSURE, FOREGROUND

_LAYERS = 2  # screen and floor
_ROUNDS = 4
_DEGREE = 2  # light that falls off, as in `image.exposure`
_BLACK = 4  # grey levels: a bar is not lit at all


def backdrop_of(
    samples: Float32Array, radius: float, asked: bool = False
) -> tuple[Float32Array, BoolArray] | None:
    """The field (h, w, 3) of a uniform backdrop in frames (T, h, w, 3) of one exposure, and where
    somebody is before it at some time, (h, w) bool; None where there is none.

    Args:
        samples: BGR of 255.
        radius: difference, summed over the channels, that is more than noise.
        asked: whether it is known that the backdrop is uniform.
    """
    median = np.median(samples, axis=0).astype(np.float32)
    rim, inside = _rim(median)
    fields = _fields(median, rim, inside)
    explained = [_explained(median, field)[rim] > 0 for field in fields]
    if not fields or (not asked and np.any(explained, axis=0).mean() < BACKDROP.rim):
        return None
    limit = tolerance(radius)
    mean = _nearest([_seen(samples, field, limit, rim) for field in fields], fields)
    near = np.stack([_apart(sample, mean) < limit for sample in samples])
    moved = ~np.stack([_apart(sample, median) < limit for sample in samples]).all(axis=0) & inside
    if not asked and moved.any() and near[:, moved].any(axis=0).mean() < BACKDROP.before:
        return None
    strange = opened(~near.all(axis=0) & inside, 3)
    usually = opened((_apart(median, mean) >= limit) & inside, 3)
    core = np.flatnonzero((inside & ~rim).any(axis=1))
    above = rim.copy()
    above[int(core.max(initial=-1)) + 1 :] = False
    return mean, pieces_with(strange, opened(moved, 3)) & ~pieces_with(usually, above)


def only_shaded(colours: Float32Array, field: Float32Array, radius: float) -> BoolArray:
    """Where colours (h, w, 3) may be the field's (h, w, 3) in a shadow, (h, w) bool."""
    light = (colours * field).sum(axis=2) / np.maximum(np.square(field).sum(axis=2), 1)
    shade = np.clip(light, FOREGROUND.shadow, 1)[..., None]
    return _apart(colours, shade * field) < tolerance(radius)


def tolerance(radius: float) -> float:
    """Largest difference of a colour and the field that explains it, with that of noise."""
    return float(max(radius, BACKDROP.tolerance))


def _apart(first: RealArray, second: RealArray) -> RealArray:
    """Difference of colours (..., 3), summed over the channels."""
    apart = np.abs(first - second)
    return apart[..., 0] + apart[..., 1] + apart[..., 2]  # faster than a sum of three


def _explained(median: Float32Array, field: RealArray) -> RealArray:
    """How well a field explains colours (..., 3): 1 is exact, 0 not at all."""
    return np.maximum(1 - (_apart(median, field) / BACKDROP.tolerance) ** 2, 0)


def _rim(median: Float32Array) -> tuple[BoolArray, BoolArray]:
    """Rim of a picture (h, w, 3) within its black bars, and all within them, (h, w) bool."""
    inside = np.zeros(median.shape[:2], np.bool_)
    inside[bounding_box(median.max(axis=2) > _BLACK)] = True
    # Pixels beside bars are mixed.
    inside = cv2.erode(inside.view(np.uint8), np.ones((3, 3), np.uint8)).view(np.bool_)
    shorter = min(inside.any(axis=0).sum(), inside.any(axis=1).sum())
    side = 2 * max(2, round(BACKDROP.width * shorter)) + 1
    padded = np.pad(inside.view(np.uint8), 1)
    core = cv2.erode(padded, np.ones((side, side), np.uint8))[1:-1, 1:-1].view(np.bool_)
    return inside & ~core, inside


def _fields(median: Float32Array, rim: BoolArray, inside: BoolArray) -> list[Float32Array]:
    """Smooth fields (h, w, 3) that explain most of the rim, the larger one first."""
    y, x = np.mgrid[-1 : 1 : rim.shape[0] * 1j, -1 : 1 : rim.shape[1] * 1j]
    orders = range(_DEGREE + 1)
    powers = np.stack([x**i * y**j for i in orders for j in orders if i + j in orders], axis=-1)
    beside, left = np.abs(x) > np.abs(y), inside.copy()
    sides = ~beside & (y < 0), ~beside & (y > 0), beside & (x < 0), beside & (x > 0)
    fields: list[Float32Array] = []
    while len(fields) < _LAYERS:
        starts = [left & side for side in sides if (left & rim & side).any()]
        candidates = [_field(median, powers, start, left) for start in starts]
        explained = [_explained(median, field) for field in candidates]
        if not candidates:
            break
        best = int(np.argmax([one[left].sum() for one in explained]))
        if explained[best][left & rim].sum() < BACKDROP.layer * rim.sum():
            break
        fields.append(candidates[best])
        left &= explained[best] == 0
    return fields


def _field(
    median: Float32Array, powers: FloatArray, start: BoolArray, left: BoolArray
) -> Float32Array:
    """Field (h, w, 3) of most of a side, then of what else it explains (Geman-McClure weights)."""
    solution = np.zeros((powers.shape[-1], 3))
    solution[0] = np.median(median[start], axis=0)
    basis, colours = powers[start], median[start]
    for number in range(3 * _ROUNDS):
        if number == _ROUNDS:
            basis, colours = powers[left], median[left]
        off = _apart(colours, basis @ solution)
        scale = max(float(np.median(off)) if number < _ROUNDS else 0, BACKDROP.tolerance)
        weight = 1 / (1 + (off / scale) ** 2) ** 2
        weighted = basis * weight[:, None]
        held = EXPOSURE.stiffness * weight.sum() * np.diag(np.arange(basis.shape[1]) > 0)
        solution = np.linalg.solve(weighted.T @ basis + held, weighted.T @ colours)
    return np.asarray((powers @ solution).clip(0, 255), np.float32)


def _seen(samples: Float32Array, field: Float32Array, limit: float, rim: BoolArray) -> IntArray:
    """Number of frames (h, w) that show a field, where it reaches the rim, unbroken."""
    count = np.sum([_apart(sample, field) < limit for sample in samples], axis=0)
    unhidden = count > 0.5 * len(samples)
    return count * pieces_with(unhidden, unhidden & rim)


def _nearest(seen: list[IntArray], fields: list[Float32Array]) -> Float32Array:
    """The field that is seen most, (h, w, 3); where none is, the one nearest to the place."""
    distances = [
        cv2.distanceTransform((count == 0).astype(np.uint8), cv2.DIST_L2, 5)
        if count.any()
        else np.full(count.shape, np.inf)
        for count in seen
    ]
    label = np.argmin(np.stack(distances) - 1e-3 * np.stack(seen), axis=0)
    return np.take_along_axis(np.stack(fields), label[None, ..., None], axis=0)[0]
