"""Refined background subtraction: this project's extension of Okada and Stenger's section 5.1.

The paper's two tests (direction of colour, clear difference) are extended as follows:

1. Exposure: each channel's gain between background and frame is the median ratio over the image.
2. The direction test uses the chromatic residual, the part of a colour that no change of brightness
   explains, divided by the noise and averaged over a small window: a cast shadow keeps its tint, a
   grey shirt before a tinted wall does not. The noise is rescaled for every frame by the median
   residual of the image, since a still does not show it and lossy video adds to it.
3. The clear difference is a brightness that neither shadow nor highlight explains.
4. Where the background alone does not decide (clothes that resemble its shadow or itself, narrow
   gaps), the colours of the silhouette so far are compared with the colours around it; where a
   recording's frames can be read beforehand, a minimum cut (`image.cut`) does both.
5. The darkest cast shadow is measured in the recording: where nothing but the brightness differs,
   its ratio to the background's has a peak at that of the shadow.
6. Edges are placed where half of a pixel's colour is the person's and half the (shadowed)
   background's, which compensates for the averaging and for the subsampled colour of video.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from silhouette_core.image.cast_shadow import only_darker
from silhouette_core.image.cleanup import bounding_box, clean
from silhouette_core.image.difference import (
    UNIT,
    Background,
    Exposure,
    FrameView,
    detect,
    grown,
    looked_at,
    measure_gain,
    noise_scale,
    pooled_brightness,
)
from silhouette_core.image.grey import texture_evidence
from silhouette_core.image.kernels import foreground as kernels
from silhouette_core.tuning import FOREGROUND

_COLOUR_SHIFT = 4  # histograms of 16 x 16 x 16 colours
_SPARSE = 4  # px between the pixels from which the usual difference is estimated


@dataclass(frozen=True, eq=False)
class SoftSilhouette:
    """A silhouette, and where else a frame differs from the background by more than its noise.

    Attributes:
        silhouette: (H, W) bool.
        tint: (H, W) bool, the colour's direction differs, or without colours the brightness:
            clothes may resemble the background.
    """

    silhouette: NDArray[np.bool_]
    tint: NDArray[np.bool_]

    @classmethod
    def of(cls, silhouette: NDArray[np.bool_]) -> "SoftSilhouette":
        """A silhouette (H, W) bool beside which nothing differs."""
        return cls(silhouette, np.zeros_like(silhouette))

    def __iter__(self) -> Iterator[NDArray[np.bool_]]:
        """Yields silhouette and tint."""
        return iter((self.silhouette, self.tint))


@dataclass(frozen=True, eq=False)
class SilhouetteStages:
    """How the silhouette of one frame came about; what a method does not compute is None.

    Attributes:
        frame: (H, W, 3) uint8, BGR, with the exposure of the background.
        background: (H, W, 3) float32, BGR of 255.
        known: (H, W) bool, where the empty scene was seen; elsewhere the background is a guess.
        first: (H, W) bool, the person before edges, colours around it, cleaning and region.
        silhouette: (H, W) bool.
        difference: (H, W) float32, of colour or of brightness beyond shadow and highlight, from 1
            on larger than noise and shadows explain.
        odds: (H, W) float32, nats of the person, by which the frame is cut (`image.cut`).
        brightness: (H, W) float32, relative to the background's.
        shadow: (H, W) bool, only darker, and not darker than a cast shadow.
    """

    frame: NDArray[np.uint8]
    background: NDArray[np.float32]
    known: NDArray[np.bool_]
    first: NDArray[np.bool_]
    silhouette: NDArray[np.bool_]
    difference: NDArray[np.float32] | None = None
    odds: NDArray[np.float32] | None = None
    brightness: NDArray[np.float32] | None = None
    shadow: NDArray[np.bool_] | None = None


def refined_soft_silhouette(
    frame: NDArray[np.uint8],
    background: Background,
    region: NDArray[np.bool_] | None = None,
    cut: NDArray[np.bool_] | None = None,
) -> SoftSilhouette:
    """Silhouette as `segmented`, and where else the frame differs from the background."""
    looked = _Looked.at(frame, background, region, cut)
    noise, radius = looked.exposure.noise, background.radius

    def beyond_noise(difference: NDArray[np.floating], least: float) -> NDArray[np.bool_]:
        usual = float(np.quantile(difference[::_SPARSE, ::_SPARSE], FOREGROUND.empty_share))
        limit = max(least, FOREGROUND.beyond * usual)
        found = ~grown(difference <= limit, radius, cv2.MORPH_RECT)  # averaging widened it so
        return found if region is None else found & region

    if background.grey:  # where nothing has a tint
        differs = beyond_noise(np.abs(looked.bright) / np.float32(noise), FOREGROUND.pooled)
    else:
        differs = beyond_noise(_chroma(looked.pooled), FOREGROUND.possible)
    return SoftSilhouette(looked.silhouette, differs)


def refined_stages(
    frame: NDArray[np.uint8],
    background: Background,
    region: NDArray[np.bool_] | None = None,
    cut: NDArray[np.bool_] | None = None,
) -> SilhouetteStages:
    """Silhouette as `segmented`, and how it came about; without the odds by which it was cut."""
    looked = _Looked.at(frame, background, region, cut)
    brightness = 1 + looked.bright / background.scales[2]
    dark = only_darker(looked.pooled, looked.bright, looked.exposure.noise)
    beyond = looked.pooled[3] / np.float32(FOREGROUND.brightness * UNIT)
    return SilhouetteStages(
        frame=np.rint((frame / looked.exposure.gain).clip(0, 255)).astype(np.uint8),
        background=background.mean,
        known=background.known,
        first=looked.first,
        silhouette=looked.silhouette,
        difference=np.maximum(_chroma(looked.pooled) / np.float32(FOREGROUND.pooled), beyond),
        brightness=brightness,
        shadow=dark & (brightness >= background.shadow),
    )


@dataclass(frozen=True, eq=False)
class _Looked:
    """A whole frame, its silhouette and first mask (H, W), and how it differs: pooled evidence (4,
    H, W) and brightness (H, W), in noise.
    """

    exposure: Exposure
    view: FrameView
    silhouette: NDArray[np.bool_]
    first: NDArray[np.bool_]
    pooled: NDArray[np.int16]
    bright: NDArray[np.float32]

    @classmethod
    def at(
        cls,
        frame: NDArray[np.uint8],
        background: Background,
        region: NDArray[np.bool_] | None,
        cut: NDArray[np.bool_] | None,
    ) -> "_Looked":
        view, exposure = looked_at(frame, background)
        found = segmented(frame, background, region, exposure, None, cut)
        return cls(exposure, view, *found, detect(view, exposure.noise)[1], pooled_brightness(view))


def _chroma(pooled: NDArray[np.int16]) -> NDArray[np.float32]:
    """Length (H, W) of the chromatic residual in pooled evidence (4, H, W), in noise."""
    first, second, third = pooled[:3].astype(np.float32) / np.float32(UNIT)
    return np.asarray(cv2.magnitude(cv2.magnitude(first, second), third), np.float32)


def segmented(
    frame: NDArray[np.uint8],
    background: Background,
    region: NDArray[np.bool_] | None = None,
    exposure: Exposure | None = None,
    window: tuple[slice, slice] | None = None,
    cut: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Silhouette (H, W) bool of a frame (H, W, 3) uint8 by the steps named above, and the mask of
    the first steps, in the window.

    Args:
        frame: the frame, or its part in the window.
        background: of the whole frame's size.
        region: (H, W) bool, where the person may be; None: everywhere.
        exposure: of the whole frame, by `measure_exposure`; None: measured here, on a whole frame.
        window: rows and columns outside of which nothing is looked for; None: the whole frame.
        cut: (H, W) bool, the silhouette before its edges are sharpened (`image.cut`); None: by the
            background alone.
    """
    everywhere = silhouette = np.zeros(background.mean.shape[:2], np.bool_)
    gain = measure_gain(frame, background) if exposure is None else exposure.gain
    if window is not None:
        background = background.part(window)
        region = None if region is None else region[window]
        silhouette = silhouette[window]
    view = FrameView.of(frame, background, gain)
    first, decide = cut, None
    if first is None:
        scale = noise_scale(view) if exposure is None else exposure.noise
        first, pooled = detect(view, scale)
        if background.grey:
            dark = only_darker(pooled, pooled_brightness(view), scale)
            first |= dark & (texture_evidence(view, min(everywhere.shape)) > 0)
        decide = pooled, scale
    mask = _clean(first, region, everywhere.size)
    if not mask.any():
        return everywhere, first
    box = bounding_box(mask, margin=8 * background.radius)
    view, mask = view.part(box), mask[box]
    mask = _sharpen(view, mask)
    if decide is not None:
        pooled, scale = decide
        mask = _decide_by_colours(view, mask, np.ascontiguousarray(pooled[:, *box]), scale)
        mask = _sharpen(view, mask)
    region = None if region is None else region[box]
    silhouette[box] = _clean(mask, region, everywhere.size)
    return everywhere, first


def _decide_by_colours(
    view: FrameView, mask: NDArray[np.bool_], pooled: NDArray[np.int16], scale: float
) -> NDArray[np.bool_]:
    """Mask in which the colours inside and around the silhouette decide the doubtful pixels."""
    radius = view.background.radius
    near = grown(mask, 7 * radius, cv2.MORPH_RECT)
    odds = _log_fractions(view.frame, ~grown(~mask, 1)) - _log_fractions(
        view.frame, near & ~grown(mask, 2)
    )
    score, bright = np.empty(mask.shape, np.float32), np.empty(mask.shape, np.float32)
    kernels.look_up(view.frame, np.clip(odds, -4, 4), _COLOUR_SHIFT, score)
    kernels.brightness(*view.arrays, bright)
    # Background of the usual brightness that was included because of subsampled colour.
    surplus = (cv2.blur(score, (3, 3)) < -FOREGROUND.colours) & (
        np.abs(cv2.blur(bright, (3, 3))) < 3 * scale
    )
    window = (2 * radius + 1, 2 * radius + 1)
    score, bright = cv2.blur(score, window), cv2.blur(bright, window)
    # The person where the difference is as small as a shadow's ...
    doubtful = np.empty(mask.shape, np.bool_)
    kernels.doubt(
        pooled, bright, round(0.5 * FOREGROUND.pooled * UNIT), np.float32(3 * scale), doubtful
    )
    # ... or in a narrow gap of the silhouette, where clothes and background may be of one colour.
    gap = ~grown(~grown(mask, 4 * radius, cv2.MORPH_RECT), 4 * radius, cv2.MORPH_RECT)
    added = near & (
        (doubtful & (score > FOREGROUND.colours)) | (gap & (score > FOREGROUND.colours_gap))
    )
    return (mask & ~surplus) | added


def _log_fractions(frame: NDArray[np.uint8], where: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Logarithm of each colour's fraction of the pixels of a mask, (16, 16, 16), smoothed."""
    bins, half = 256 >> _COLOUR_SHIFT, np.float32(0.5)
    counts = cv2.calcHist([frame], (0, 1, 2), where.view(np.uint8), (bins,) * 3, (0, 256) * 3)
    whole = counts.sum() + half * counts.size
    for axis in range(3):
        counts = convolve1d(counts, (0.25, 0.5, 0.25), axis, mode="nearest")
    return np.log((counts + half) / whole)


def _sharpen(view: FrameView, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask with edges moved by at most `radius` pixels, to where person and background each make up
    half of a pixel.
    """
    radius = view.background.radius
    near, shrunk = grown(mask, radius), ~grown(~mask, radius)
    gap = max(1, radius // 2)  # pixels at the edge are mixed: they show neither colour
    inside, outside = ~grown(~mask, gap), ~grown(mask, gap)
    moved = mask.copy()
    light = 0.2 * view.gain, 2 * view.gain  # largest effect of shadows and reflections
    images = view.planes, view.background.planes
    regions = near & ~shrunk, inside, outside
    contrast = np.float32(FOREGROUND.contrast)
    kernels.sharpen(*images, *light, *regions, 2 * radius, contrast, moved)
    return moved


def _clean(
    mask: NDArray[np.bool_], region: NDArray[np.bool_] | None, pixels: int
) -> NDArray[np.bool_]:
    """Mask (H, W) without the components and holes that are small for an image of `pixels`."""
    area, hole = round(FOREGROUND.area * pixels), round(FOREGROUND.hole * pixels)
    share = FOREGROUND.body_share
    return clean(mask, min_area_px=area, min_share=share, max_hole_px=hole, region=region)
