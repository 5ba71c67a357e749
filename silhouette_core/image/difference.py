"""How a frame differs from the background: noise, and residuals pooled over windows.

"Noise" is a channel's standard deviation at the pixel, as rescaled for the frame.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from calib.checks import BoolArray, ByteArray, Float32Array, RealArray
from silhouette_core.image.kernels import foreground as kernels
from silhouette_core.tuning import FOREGROUND

_GRID = 16  # px between the pixels from which noise is estimated
_UNIT = 1000  # integer steps of the pooled residual in one noise


@dataclass(frozen=True, eq=False)
class Background:
    """Colours of the empty scene, and the scales of differences from them."""

    mean: Float32Array  #: (H, W, 3) float32, BGR of 255.
    planes: Float32Array  #: (3, H, W) float32, the same, channel by channel.
    scales: Float32Array  #: (3, H, W) float32: 1 / |mean|^2, 1 / noise, |mean| / noise.
    known: BoolArray  #: (H, W) bool, where the empty scene was seen; elsewhere it is a guess.
    radius: int  #: half width of the window over which residuals are pooled, px.
    shadow: float = FOREGROUND.shadow  #: Darkest cast shadow, of the background's brightness.
    grey: bool = False  #: whether the camera films without colour, so that no tint tells a shadow.
    several: bool = False
    """Whether other cameras film the same: a shadow that counts as the person costs little then,
    since it lies on the floor, and a limb that counts as a shadow much."""

    @classmethod
    def from_noise(cls, mean: Float32Array, noise: RealArray) -> "Background":
        """Background from the mean and each pixel's standard deviation (H, W), of 255."""
        square = np.maximum(np.square(mean, dtype=np.float64).sum(axis=2), 1.0)
        scales = np.stack([1 / square, 1 / noise, np.sqrt(square) / noise]).astype(np.float32)
        planes = np.ascontiguousarray(mean.transpose(2, 0, 1))
        size = mean.shape[:2]
        return cls(mean, planes, scales, np.ones(size, np.bool_), window_radius(size))

    def part(self, window: tuple[slice, slice]) -> "Background":
        """Background in a window of rows and columns."""
        planes, scales = (
            np.ascontiguousarray(array[:, *window]) for array in (self.planes, self.scales)
        )
        known = np.ascontiguousarray(self.known[window])
        return replace(self, mean=self.mean[window], planes=planes, scales=scales, known=known)


@dataclass(frozen=True, eq=False)
class FrameView:
    """A frame (H, W, 3), or a window of it, with the exposure of its background, and the same
    channel by channel (3, H, W).
    """

    frame: ByteArray
    planes: ByteArray
    background: Background

    @property
    def arrays(self) -> tuple[ByteArray, Float32Array, Float32Array]:
        """First arguments of the kernels."""
        return self.planes, self.background.planes, self.background.scales

    @classmethod
    def of(cls, frame: ByteArray, background: Background) -> "FrameView":
        """FrameView of a frame (H, W, 3), or of a window of it, and of its background."""
        return cls(frame, np.asarray(cv2.split(frame), np.uint8), background)


def window_radius(size: tuple[int, ...]) -> int:
    """Half width of the window over which residuals are pooled in images of a size, px."""
    return max(1, round(min(size) / 240))


def noise_scale(view: FrameView) -> float:
    """Ratio of the frame's noise to the model's, at least 1."""
    height, width = view.frame.shape[:2]
    sampled = np.empty((-(-height // _GRID), -(-width // _GRID)), np.float32)
    clip = np.float32(FOREGROUND.chroma_pixel)
    kernels.sampled_chroma(*view.arrays, clip, view.background.radius, _GRID, sampled)
    return max(1.0, float(np.median(sampled)) / FOREGROUND.usual_chroma)


def pooled_chroma(view: FrameView, noise: float) -> Float32Array:
    """Length (H, W) of the chromatic residual averaged over windows, in the frame's noise, whose
    ratio to the model's is `noise`.
    """
    side, (height, width) = 2 * view.background.radius + 1, view.frame.shape[:2]
    parts = np.empty((3, height, width), np.int16)
    unit, clip = np.float32(_UNIT / noise), np.float32(FOREGROUND.chroma_pixel * noise)
    kernels.residuals(*view.arrays, unit, clip, parts)
    for part in parts:
        cv2.blur(part, (side, side), part)
    first, second, third = parts.astype(np.float32) / np.float32(_UNIT)
    return np.asarray(cv2.magnitude(cv2.magnitude(first, second), third), np.float32)


def grown(mask: BoolArray, pixels: int) -> BoolArray:
    """Mask (H, W) dilated by a disc of a radius in pixels."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * pixels + 1, 2 * pixels + 1))
    return np.asarray(cv2.dilate(mask.view(np.uint8), disc), np.uint8).view(np.bool_)


def pooled_brightness(view: FrameView) -> Float32Array:
    """Signed difference along the background's colour, averaged over windows, (H, W), in noise."""
    bright = np.empty(view.frame.shape[:2], np.float32)
    kernels.brightness(*view.arrays, bright)
    side = 2 * view.background.radius + 1
    return np.asarray(cv2.blur(bright, (side, side)), np.float32)
