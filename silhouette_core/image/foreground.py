"""Refined background subtraction: this project's extension of Okada and Stenger's section 5.1.

1. A frame is given the exposure of the background (`image.exposure`). Its noise is rescaled by the
   median chromatic residual of the image, the part of a colour that no change of brightness
   explains: a still does not show it, and lossy video adds to it.
2. The darkest cast shadow is measured in the recording: where nothing but the brightness differs,
   its ratio to the background's has a peak at that of the shadow (`image.cast_shadow`).
3. Each pixel's odds compare the background, lit or in a shadow, with any other colour, or with the
   person's where frames can be read beforehand; a minimum cut decides (`image.cut`).
4. Edges are placed where half of a pixel's colour is the person's and half the (shadowed)
   background's, which compensates for the cut's size and for the subsampled colour of video.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.checks import BoolArray, ByteArray, Float32Array, RealArray
from silhouette_core.image.cast_shadow import only_darker
from silhouette_core.image.cleanup import bounding_box, clean, dilated
from silhouette_core.image.difference import (
    Background,
    FrameView,
    grown,
    noise_scale,
    pooled_brightness,
    pooled_chroma,
)
from silhouette_core.image.kernels import foreground as kernels
from silhouette_core.tuning import FOREGROUND

_SPARSE = 4  # px between the pixels from which the usual difference is estimated


@dataclass(frozen=True, eq=False)
class SoftSilhouette:
    """A silhouette, and where else a frame differs from the background by more than its noise."""

    silhouette: BoolArray  #: (H, W) bool.
    tint: BoolArray
    """(H, W) bool, the colour's direction differs, or without colours the brightness: clothes may
    resemble the background."""

    @classmethod
    def of(cls, silhouette: BoolArray) -> "SoftSilhouette":
        """A silhouette (H, W) bool beside which nothing differs."""
        return cls(silhouette, np.zeros_like(silhouette))

    def __iter__(self) -> Iterator[BoolArray]:
        """Yields silhouette and tint."""
        return iter((self.silhouette, self.tint))


@dataclass(frozen=True, eq=False)
class SilhouetteStages:
    """How the silhouette of one frame came about; what a method does not compute is None."""

    frame: ByteArray  #: (H, W, 3) uint8, BGR, with the exposure of the background.
    background: Float32Array  #: (H, W, 3) float32, BGR of 255.
    known: BoolArray  #: (H, W) bool, where the empty scene was seen; elsewhere it is a guess.
    first: BoolArray  #: (H, W) bool, the person before edges, cleaning and region.
    silhouette: BoolArray  #: (H, W) bool.
    odds: Float32Array | None = None
    """(H, W) float32, nats of the person, by which the frame is cut (`image.cut`)."""
    brightness: Float32Array | None = None  #: (H, W) float32, relative to the background's.
    shadow: BoolArray | None = None  #: (H, W) bool, only darker, and not darker than a cast shadow.


def refined_soft_silhouette(
    frame: ByteArray, background: Background, cut: BoolArray, region: BoolArray | None = None
) -> SoftSilhouette:
    """Silhouette as `segmented`, and where else the frame differs from the background."""
    view = FrameView.of(frame, background)
    noise = noise_scale(view)

    def beyond_noise(difference: RealArray, least: float) -> BoolArray:
        usual = float(np.quantile(difference[::_SPARSE, ::_SPARSE], FOREGROUND.empty_share))
        limit = max(least, FOREGROUND.beyond * usual)
        # Averaging widened it so.
        beyond = ~dilated(difference <= limit, 2 * background.radius + 1)
        return beyond if region is None else beyond & region

    if background.grey:  # where nothing has a tint
        bright = pooled_brightness(view)
        differs = beyond_noise(np.abs(bright) / np.float32(noise), FOREGROUND.pooled)
    else:
        differs = beyond_noise(pooled_chroma(view, noise), FOREGROUND.possible)
    return SoftSilhouette(segmented(frame, background, cut, region), differs)


def refined_stages(
    frame: ByteArray, background: Background, cut: BoolArray, region: BoolArray | None = None
) -> SilhouetteStages:
    """Silhouette as `segmented`, and how it came about; without the odds by which it was cut."""
    view = FrameView.of(frame, background)
    noise, bright = noise_scale(view), pooled_brightness(view)
    brightness = 1 + bright / background.scales[2]
    return SilhouetteStages(
        frame=frame,
        background=background.mean,
        known=background.known,
        first=cut,
        silhouette=segmented(frame, background, cut, region),
        brightness=brightness,
        shadow=only_darker(view, bright, noise) & (brightness >= background.shadow),
    )


def segmented(
    frame: ByteArray,
    background: Background,
    cut: BoolArray,
    region: BoolArray | None = None,
    window: tuple[slice, slice] | None = None,
) -> BoolArray:
    """Silhouette (H, W) bool of a frame uint8 by a cut: cleaned, with sharp edges.

    Args:
        frame: (h, w, 3), what of the frame is in the window, with the exposure of the background.
        background: of the whole frame's size.
        cut: (h, w) bool, the silhouette as it was cut (`image.cut`).
        region: (H, W) bool, where the person may be; None: everywhere.
        window: rows and columns outside of which nothing is looked for; None: the whole frame.
    """
    everywhere = np.zeros(background.mean.shape[:2], np.bool_)
    inside = (slice(0, None), slice(0, None)) if window is None else window
    mask = _clean(cut, None if region is None else region[inside], everywhere.size)
    if not mask.any():
        return everywhere
    box = bounding_box(mask, margin=8 * background.radius)
    rows, columns = (
        slice(first.start + near.start, first.start + min(near.stop, side))
        for first, near, side in zip(inside, box, mask.shape, strict=True)
    )
    view = FrameView.of(frame[box], background.part((rows, columns)))
    within = None if region is None else region[rows, columns]
    everywhere[rows, columns] = _clean(_sharpen(view, mask[box]), within, everywhere.size)
    return everywhere


def _sharpen(view: FrameView, mask: BoolArray) -> BoolArray:
    """Mask with edges moved by at most `radius` pixels, to where half of a pixel is the person."""
    radius = view.background.radius
    near, shrunk = grown(mask, radius), ~grown(~mask, radius)
    gap = max(1, radius // 2)  # pixels at the edge are mixed: they show neither colour
    inside, outside = ~grown(~mask, gap), ~grown(mask, gap)
    moved = mask.copy()
    planes, mean, edge = view.planes, view.background.planes, near & ~shrunk
    contrast = np.float32(FOREGROUND.contrast)
    light = np.float32(0.2), np.float32(2)  # largest effects of shadows and of reflections
    kernels.sharpen(planes, mean, light, edge, inside, outside, 2 * radius, contrast, moved)
    return moved


def _clean(mask: BoolArray, region: BoolArray | None, pixels: int) -> BoolArray:
    """Mask (H, W) without the components and holes that are small for an image of `pixels`."""
    area, hole = round(FOREGROUND.area * pixels), round(FOREGROUND.hole * pixels)
    share = FOREGROUND.body_share
    return clean(mask, min_area_px=area, min_share=share, max_hole_px=hole, region=region)
