"""Colours of a person's head, learned from the pictures in which its place is known.

Hands and bare arms share them, clothes mostly do not: what has these colours before the trunk is an
arm, which no silhouette shows. Nothing is assumed about the colours themselves. Source: own; colour
histograms as likelihoods after Jones and Rehg, Statistical color models with application to skin
detection (2002).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray
from silhouette_core.image.shading import chromaticity
from silhouette_core.tuning import COLOURS

_BINS = (8, 32, 32)  # of lightness and of the two axes of colour of CIELAB
_SHIFTS = (5, 3, 3)
_LEAST_PX = 200  # of the head, before anything is said


@dataclass(frozen=True, eq=False)
class ColourCrop:
    """Colours in the rectangle of a picture that holds the person."""

    bins: NDArray[np.uint16]  #: (h, w) uint16, numbers of the colours, from `quantise`.
    chromaticity: NDArray[np.uint16]  #: (h, w) uint16, from `shading.chromaticity`.
    grey: ByteArray  #: (h, w) uint8, brightness.
    corner: tuple[int, int]  #: column and row of the first pixel in the picture.

    @classmethod
    def of(cls, picture: ByteArray, corner: tuple[int, int]) -> "ColourCrop":
        """Crop of a part (h, w, 3) of a picture, BGR, whose first pixel is at a corner."""
        grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
        return cls(quantise(picture), chromaticity(picture), grey, corner)

    def part(self, image: BoolArray) -> BoolArray:
        """The rectangle (h, w) of an image as large as the picture."""
        (height, width), (left, top) = self.bins.shape, self.corner
        return image[top : top + height, left : left + width]


def quantise(picture: ByteArray) -> NDArray[np.uint16]:
    """Numbers (h, w) uint16, below 8192, of the colours of a picture (h, w, 3) uint8, BGR."""
    lab = np.asarray(cv2.split(cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)), np.uint8)
    one, two, three = (axis >> shift for axis, shift in zip(lab, _SHIFTS, strict=True))
    return (
        np.multiply(one, _BINS[1] * _BINS[2], dtype=np.uint16)
        + np.multiply(two, _BINS[2], dtype=np.uint16)
        + three
    )


def coarse_histogram(bins: NDArray[np.uint16]) -> FloatArray:
    """Shares (2048,) float64 of a quarter as many colours among numbers (n,) from `quantise`."""
    counts = np.bincount(bins, minlength=int(np.prod(_BINS)))
    fine = counts.reshape(_BINS[0], _BINS[1] // 2, 2, _BINS[2] // 2, 2)
    return fine.sum(axis=(2, 4)).ravel() / max(len(bins), 1)


def unlikeness(first: FloatArray, second: FloatArray) -> FloatArray:
    """How different histograms (..., n) of shares are, (...) from 0 to 1: Hellinger's distance."""
    return np.asarray(np.sqrt(np.maximum(1 - np.sqrt(first * second).sum(axis=-1), 0)), float)


class HeadColours:
    """Histograms of the colours of the head and of the rest of a person."""

    def __init__(self) -> None:
        size = int(np.prod(_BINS))
        self._head, self._rest = np.zeros(size), np.zeros(size)

    def add(self, bins: NDArray[np.uint16], head: BoolArray, person: BoolArray) -> None:
        """Adds a picture.

        Args:
            bins: (h, w) uint16, colours, from `quantise`.
            head: (h, w) bool, pixels of the head.
            person: (h, w) bool, pixels of the person, head included.
        """
        size = len(self._head)
        self._head += np.bincount(bins[head & person], minlength=size)
        self._rest += np.bincount(bins[person & ~head], minlength=size)

    def likelihood(self) -> Float32Array | None:
        r"""How much likelier each colour (8192,) is on the head, 0 to 1; None: too few pixels.

        .. math:: L(c) = \frac{p(c | \text{head})}{p(c | \text{head}) + p(c | \text{rest})}
        """
        if self._head.sum() < _LEAST_PX or self._rest.sum() < _LEAST_PX:
            return None
        head, rest = (
            gaussian_filter(counts.reshape(_BINS), COLOURS.smoothing_bins).ravel() / counts.sum()
            for counts in (self._head, self._rest)
        )
        return (head / (head + rest + COLOURS.any_share / len(head))).astype(np.float32)
