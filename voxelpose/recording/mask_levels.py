"""Values that the masks of a camera hold: its background, and whatever stands before it.

A label fills areas; edges that were smoothed, and the ringing of lossy codecs, do not. Values count
that do, and lie apart from each other.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

_MOST_VALUES = 64  # beyond, they are shades and no labels
_SHADES = 16  # shades closer than this part of the largest are one
_LEAST = 1000  # a label fills this part of a picture at least, in some
_LOOKED_AT = 300_000  # pixels of a picture
_LARGEST = 65535
_SHIFT = 16  # bits of a channel

Plane = NDArray[np.float32]
"""(H, W, C) float32, whole numbers from 0 to 65535; one channel, or blue, green, red."""


class Layers(NamedTuple):
    """A picture as its file has it: (H, W) or (H, W, 3) of any type, and (H, W) alpha if any."""

    values: NDArray
    alpha: NDArray | None

    @classmethod
    def of(cls, picture: NDArray) -> "Layers":
        """Layers of a picture (H, W) or (H, W, C) with one to four channels."""
        if picture.ndim == 2:
            return cls(picture, None)
        colour, alpha = picture[..., :3], picture[..., 3] if picture.shape[2] == 4 else None
        return cls(colour[..., 0] if picture.shape[2] < 3 else colour, alpha)


@dataclass(frozen=True)
class MaskForm:
    """What of the pictures tells the person apart."""

    alpha: bool  #: whether their opacity does.
    coloured: bool  #: whether colours do.
    scale: float | None = None  #: factor that makes whole numbers of values that are none.

    @classmethod
    def of(cls, layers: Sequence[Layers], labels: bool = True) -> "MaskForm":
        """Form of a sequence by some of its pictures: alpha where it varies, and colours within it
        where they are as few as labels.

        Args:
            labels: whether colours may be labels.
        """
        alphas = [one.alpha for one in layers if one.alpha is not None]
        alpha = bool(alphas) and min(a.min() for a in alphas) < max(a.max() for a in alphas)
        coloured = labels and any(map(_is_coloured, layers))
        if alpha and coloured:
            coloured = _has_few_values(map(_opaque, layers))
        arrays = alphas if alpha and not coloured else [one.values for one in layers]
        return cls(alpha, coloured, _scale(arrays))

    def plane(self, layers: Layers) -> Plane:
        """Values that count; where colours count within what is opaque, black without."""
        values, alpha = layers
        if self.alpha and not self.coloured:
            values = np.ones(values.shape[:2], np.uint8) if alpha is None else alpha
        elif self.alpha:
            values = _opaque(layers)
        if self.coloured and values.ndim == 2:
            values = np.repeat(values[..., None], 3, axis=2)
        if not self.coloured and values.ndim == 3:
            values = values.max(axis=2)
        plane = np.nan_to_num(values.astype(np.float32), nan=0.0)
        if self.scale is not None:
            with np.errstate(over="ignore"):  # of values beyond the samples'
                plane = np.rint(plane * np.float32(self.scale))
        return plane.clip(0, _LARGEST).reshape(*plane.shape[:2], -1)


def _is_coloured(layers: Layers) -> bool:
    """Whether channels differ, beyond the errors of a lossy codec, in a part worth the name."""
    if layers.values.ndim == 2:
        return False
    values = _opaque(layers)
    apart = values.max(axis=2).astype(np.float64) - values.min(axis=2)
    most = float(apart.max())
    wide = np.count_nonzero(apart > most / 2) * _LEAST > apart.size
    return bool(wide and most * _SHADES > 2 * float(values.max()))


def _opaque(layers: Layers) -> NDArray:
    """Values of a picture where it is not transparent, black elsewhere."""
    if layers.alpha is None or layers.values.ndim == 2:
        return layers.values
    return layers.values * (layers.alpha > 0)[..., None]


@np.errstate(invalid="ignore")  # of infinite values, which are no whole numbers
def _scale(arrays: Sequence[NDArray]) -> float | None:
    """Factor of values: none where they are whole numbers already."""
    top = max((float(np.nanmax(one, initial=0)) for one in arrays), default=0.0)
    whole = all(one.dtype.kind in "bui" or not np.any(one % 1) for one in arrays)
    if (whole and top <= _LARGEST) or not 0 < top < np.inf:
        return None
    return _LARGEST / top


def codes_of(plane: Plane) -> NDArray[np.int64]:
    """One number (H, W) for each value of a plane."""
    channels = plane.astype(np.int64)
    code = channels[..., 0]
    for k in range(1, channels.shape[2]):
        code = code | channels[..., k] << _SHIFT * k
    return code


def _has_few_values(pictures: Iterable[NDArray]) -> bool:
    """Whether pictures hold no more values than labels do."""
    codes: set[int] = set()
    for picture in pictures:
        codes |= set(np.unique(codes_of(np.atleast_3d(_subsampled(picture)))).tolist())
    return len(codes) <= _MOST_VALUES


def _subsampled(picture: NDArray) -> NDArray:
    """Every so many pixels, as many as are looked at."""
    step = max(1, int(np.ceil((picture.shape[0] * picture.shape[1] / _LOOKED_AT) ** 0.5)))
    return picture[::step, ::step]


@dataclass(frozen=True, eq=False)
class MaskLevels:
    """Values that the masks of a camera hold."""

    values: NDArray[np.float64]
    """(L, C) float64, the background first, the others by the area that they fill."""
    exact: bool  #: whether there are no others, but for edges.
    bordered: bool  #: whether the background is plain and fills most of the pictures' borders.
    compact: bool  #: whether most of what is no background has one of these values.
    top: float  #: the largest value.
    noise: float  #: largest difference, from the background, of what is background all the same.
    indices: list[NDArray[np.int16]]
    """(h, w) int16 for each picture, every so many pixels: which value is nearest."""

    @classmethod
    def of(cls, planes: Sequence[Plane], labels: bool = True) -> "MaskLevels":
        """Values of some planes of a sequence.

        Args:
            labels: whether several values may be labels; opacity has two, and what is between.
        """
        top = max(float(plane.max()) for plane in planes)
        exact = labels and _has_few_values(planes)
        tolerance = 0.0 if exact else top / (_SHADES if labels else 4)
        flat = [_plain_areas(plane, tolerance / 2) for plane in planes]
        unordered = _area_values(flat, tolerance, planes[0].shape[2])
        thin = [_subsampled(plane) for plane in planes]
        indices = [nearest_value(plane, unordered) for plane in thin]
        border = np.concatenate([_border(one) for one in indices])
        background = int(np.bincount(border, minlength=len(unordered)).argmax())
        order = sorted(range(len(unordered)), key=lambda k: (k != background, *unordered[k]))
        values = unordered[order]
        indices = [np.argsort(order).astype(np.int16)[one] for one in indices]
        distance = [np.abs(plane - values[0]).max(axis=2) for plane in thin]
        near = np.concatenate([one[one <= tolerance] for one in distance])
        same = exact or np.count_nonzero(near >= 1) * _LEAST < near.size
        noise = 0.0 if same else tolerance
        edges = np.concatenate([_border(one) for one in distance])
        plain = 2 * int(np.count_nonzero(near <= tolerance / 4)) > near.size
        return cls(
            values,
            exact,
            plain and 2 * int(np.count_nonzero(edges <= tolerance)) > edges.size,
            exact or _is_compact(thin, indices, values, top / _SHADES),
            top,
            noise,
            indices,
        )


def _is_compact(
    planes: Sequence[Plane],
    indices: Sequence[NDArray[np.int16]],
    values: NDArray[np.float64],
    tolerance: float,
) -> bool:
    """Whether most of what is far from the background is near another value."""
    far = near = 0
    for plane, index in zip(planes, indices, strict=True):
        before = np.abs(plane - values[0]).max(axis=2) > 2 * tolerance
        far += int(np.count_nonzero(before))
        off = np.abs(plane - values[index]).max(axis=2) <= 2 * tolerance
        near += int(np.count_nonzero(before & off & (index > 0)))
    return 2 * near > far


def _plain_areas(plane: Plane, noise: float) -> Plane:
    """Values (N, C) of the pixels whose neighbours are alike."""
    kernel = np.ones((3, 3), np.uint8)
    spread = cv2.dilate(plane, kernel) - cv2.erode(plane, kernel)
    spread = spread.reshape(plane.shape).max(axis=2)
    values = _subsampled(plane)
    return values[_subsampled(spread) <= noise]


def _area_values(flat: Sequence[Plane], tolerance: float, channels: int) -> NDArray[np.float64]:
    """Values (L, C) that fill areas; of those closer than twice `tolerance` the commonest."""
    cell = max(tolerance / 2, 1.0)
    sums: defaultdict[int, NDArray[np.float64]] = defaultdict(lambda: np.zeros(channels + 1))
    large: set[int] = set()
    for values in flat:
        cells = codes_of(np.rint(values / cell)[None])[0]
        codes, which, counts = np.unique(cells, return_inverse=True, return_counts=True)
        columns = [np.bincount(which, column, len(codes)) for column in values.T]
        for code, *row in zip(codes.tolist(), counts, *columns, strict=True):
            sums[code] += row
        large |= set(codes[counts * _LEAST >= len(values)].tolist())
    chosen: list[NDArray[np.float64]] = []
    for code, (count, *total) in sorted(sums.items(), key=lambda one: -one[1][0]):
        value = np.rint(np.array(total) / count)
        if code in large and all(np.abs(value - other).max() > 2 * tolerance for other in chosen):
            chosen.append(value)
    return np.array(chosen or [np.zeros(channels)])


def nearest_value(plane: Plane, values: NDArray[np.float64]) -> NDArray[np.int16]:
    """Which of the values (L, C) is nearest to each pixel of a plane, (H, W)."""
    best = np.full(plane.shape[:2], np.inf, np.float32)
    index = np.zeros(plane.shape[:2], np.int16)
    for k, value in enumerate(values.astype(np.float32)):
        distance = np.abs(plane - value).max(axis=2)
        nearer = distance < best
        best[nearer], index[nearer] = distance[nearer], k
    return index


def _border(image: NDArray) -> NDArray:
    return np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
