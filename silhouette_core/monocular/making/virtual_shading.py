"""Light on virtual people: how bright each place is, relative to others of its colour.

Light, sky and patterns of the clothes are drawn at random. Everybody has four colours: those of
the head, of the clothes above and below, and of the shoes; now and then two of them are alike but
not as bright. The renderer draws labels, each of which is a colour and a brightness.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, Float32Array, IndexArray
from silhouette_core.body.joints import PART_NAMES, without_side
from silhouette_core.monocular.tuning import VIRTUAL_SHADING as SHADING

_COLOURS, _LEVELS = 4, 62  # labels stay below 255
_PER_UNIT, _DARKEST = 30, -3 / 2  # levels of a factor of e; logarithm of the first's brightness
_BELOW, _SHOES = ("pelvis", "thigh", "shin"), ("foot", "toes")


def lit_labels(
    surface: Float32Array,
    faces: IndexArray,
    face_part: IndexArray,
    bare: BoolArray,
    rng: np.random.Generator,
) -> NDArray[np.int32]:
    """Labels (T, F) of all faces in light that is the same in all frames.

    Args:
        surface: (T, V, 3), world, z up.
        faces: (F, 3), outward.
        face_part: (F,), part of each face.
        bare: (27,), parts that have the colour of the head.

    Source: Lambert's law; hemisphere lighting for the sky.
    """
    first, second, third = (surface[:, faces[:, k]] for k in range(3))
    normal = np.cross(second - first, third - first)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    elevation, azimuth = rng.uniform(*np.radians(SHADING.light_deg)), rng.uniform(0, 2 * np.pi)
    level = np.cos(elevation)
    toward = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    direct, sky = rng.uniform(*SHADING.direct), rng.uniform(*SHADING.sky)
    light = direct * np.maximum(normal @ toward.astype(np.float32), 0)
    brightness = np.log((1 - direct) * (1 + sky * normal[..., 2]) + light)
    if rng.random() < SHADING.patterned:
        deviation = rng.uniform(0, SHADING.pattern)
        brightness += rng.normal(0, deviation, len(faces))
        brightness += rng.normal(0, SHADING.of_parts * deviation, len(PART_NAMES))[face_part]
    levels = np.clip(np.rint((brightness - _DARKEST) * _PER_UNIT), 0, _LEVELS - 1)
    return (part_colours(bare)[face_part] * _LEVELS + levels).astype(np.int32)


def part_colours(bare: BoolArray) -> NDArray[np.intp]:
    """Number (27,) of every part's colour: 0 of bare ones, 1 above, 2 below, 3 of shoes.

    Args:
        bare: (27,), parts that have the colour of the head.
    """
    names = [without_side(name) for name in PART_NAMES]
    colours = np.array([2 if name in _BELOW else 3 if name in _SHOES else 1 for name in names])
    return np.where(bare, 0, colours)


def bare_pixels(images: ByteArray) -> ByteArray:
    """Pixels, 1 or 0, of the head's colour in images of labels: 0 background, else label + 1."""
    return ((images > 0) & (images <= _LEVELS)).view(np.uint8)


def relative_brightness(images: ByteArray, rng: np.random.Generator) -> Float32Array:
    """Logarithm of every pixel's brightness less its colour's mean in all images; 0 outside.

    Args:
        images: (T, h, w) of labels, 0 for background, else label + 1.
        rng: random numbers, for colours that are alike.
    """
    labels = np.arange(_COLOURS * _LEVELS)
    colour, value = labels // _LEVELS, labels % _LEVELS / _PER_UNIT
    if rng.random() < SHADING.alike:
        one, other = rng.choice(_COLOURS, 2, replace=False)
        value[colour == one] += rng.normal(0, SHADING.patch)
        colour[colour == one] = other
    rows = images.reshape(-1, images.shape[-1])
    count = cv2.calcHist([rows], [0], None, [256], [0, 256]).ravel()[1 : len(labels) + 1]
    pixels = np.bincount(colour, count, _COLOURS)
    mean = np.bincount(colour, count * value, _COLOURS) / np.maximum(pixels, 1)
    relative = np.zeros(256, np.float32)
    relative[1 : len(labels) + 1] = value - mean[colour]
    return np.asarray(cv2.LUT(rows, relative), np.float32).reshape(images.shape)
