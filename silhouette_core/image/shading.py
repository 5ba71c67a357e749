"""Shading of a person: how bright each pixel is, relative to others of its colour.

Light comes from above nearly everywhere, so that what faces up is brighter than what faces down: a
thigh that is lifted toward the camera than one that is lifted away from it, of which the
silhouettes are the same. How much a colour reflects is not known, but its mean brightness over a
recording is. Source: own, after Horn, Shape from shading (1970); Okada and Stenger, section 7, name
the inside of the outline as further work.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, Float32Array, check_array
from silhouette_core.tuning import COLOURS

_BINS = 64  # of red's and of green's share of a colour
_LOG = np.log(np.arange(256) + COLOURS.dark).astype(np.float32)
_LEAST_PX = 200  # of a colour and those nearest to it, before anything is said of it


def chromaticity(picture: ByteArray) -> NDArray[np.uint16]:
    """Numbers (h, w) uint16, below 4096, of the shares of red and green in a picture (h, w, 3)
    uint8, BGR, which do not depend on how brightly a surface is lit.
    """
    check_array("picture", picture, ("h", "w", 3), np.uint8)
    total = picture.sum(axis=2, dtype=np.float32) + 1
    red, green = ((picture[..., channel] * (_BINS / total)).astype(np.uint16) for channel in (2, 1))
    return red * np.uint16(_BINS) + green


class ColourBrightness:
    """Mean brightness of every colour of a person."""

    def __init__(self) -> None:
        self._count, self._sum = np.zeros((2, _BINS**2))

    def add(self, colours: NDArray[np.uint16], grey: ByteArray) -> None:
        """Adds pixels of the person.

        Args:
            colours: (n,) uint16, from `chromaticity`.
            grey: (n,) uint8, their brightness.
        """
        self._count += np.bincount(colours, minlength=_BINS**2)
        self._sum += np.bincount(colours, _LOG[grey], minlength=_BINS**2)

    def mean(self) -> Float32Array:
        """Mean logarithm (4096,) of the brightness of every colour and, with less weight, of
        colours near to it; NaN where too few pixels were seen.
        """
        count, total = (one.reshape(_BINS, _BINS) for one in (self._count, self._sum))
        seen = cv2.boxFilter(count, -1, (3, 3), normalize=False) >= _LEAST_PX
        count, total = (cv2.GaussianBlur(one, (0, 0), 1.0) for one in (count, total))
        mean = np.full((_BINS, _BINS), np.nan, np.float32)
        mean[seen] = total[seen] / count[seen]
        return mean.ravel()


def relative_shading(
    colours: NDArray[np.uint16], grey: ByteArray, mean: Float32Array, inside: BoolArray
) -> Float32Array:
    """Logarithm (h, w) float32 of the brightness relative to the colour's mean, at most a factor of
    e; 0 outside the person and where the colour is not known.

    Args:
        colours: (h, w) uint16, from `chromaticity`.
        grey: (h, w) uint8, brightness.
        mean: (4096,) float32, from `ColourBrightness.mean`.
        inside: (h, w) bool, pixels of the person.
    """
    relative = _LOG[grey] - mean[colours]
    relative[~inside | np.isnan(relative)] = 0
    return np.clip(relative, -COLOURS.shading, COLOURS.shading)
