"""Refined background subtraction: this project's extension of Okada and Stenger's section 5.1.

The paper's two tests (direction of colour, clear difference) are extended as follows:

1. Exposure: each channel's gain between background and frame is the median ratio over the image.
2. The direction test uses the chromatic residual, the part of a colour that no change of brightness
   explains, divided by the noise and averaged over a small window: a cast shadow keeps its tint, a
   grey shirt before a tinted wall does not. The noise is rescaled for every frame by the median
   residual of the image, since a still does not show it and lossy video adds to it.
3. The clear difference is a brightness that neither shadow nor highlight explains.
4. Where the background alone does not decide (clothes that resemble its shadow or itself, narrow
   gaps), the colours of the silhouette so far are compared with the colours around it.
5. The darkest cast shadow is measured in the recording: where nothing but the brightness differs,
   its ratio to the background's has a peak at that of the shadow.
6. Edges are placed where half of a pixel's colour is the person's and half the (shadowed)
   background's, which compensates for the averaging and for the subsampled colour of video.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.cleanup import clean
from silhouette_core.image.kernels import foreground as kernels

_GRID = 16  # px between the pixels from which gain and noise are estimated
_COLOUR_SHIFT = 4  # histograms of 16 x 16 x 16 colours
_UNIT = 1000  # integer steps of the pooled evidence in one noise
_USUAL_CHROMA = 0.7  # pooled chromatic residual of an empty scene whose noise is known
_SHADOW_CHROMA = 1.0  # noise: largest pooled chromatic residual of what only the light explains
_SHADOW_BRIGHTNESS = 5.0  # noise: least difference of its brightness
_SHADOW_EDGES = np.arange(0.25, 0.96, 0.02)  # of the histogram of brightness ratios
_SHADOW_PIXELS = 150  # fewest that show what shadows are like
_SHADOW_MARGIN = 0.1  # darkest shadow below the peak of the histogram
_SHADOW_CORE = 0.05  # share of the pixels that may be the core of a soft shadow
_SHADOW_CORE_MARGIN = 0.03
_SHADOW_LIMITS = 0.25, 0.5, 0.65  # lowest, usual, highest


@dataclass(frozen=True)
class RefinedSettings:
    """Thresholds of the refined method.

    "Noise" is a channel's standard deviation at the pixel, as rescaled for the frame.

    Attributes:
        chroma: limit of the pooled chromatic residual, in noise.
        possible: limit of the pooled chromatic residual where clothes may resemble the background.
        shaded: limit of the pooled difference of brightness where clothes or a shadow may be.
        chroma_pixel: limit of a single pixel's chromatic residual, in noise.
        brightness: distance of a foreground brightness from shadow and highlight, in noise.
        shadow: darkest cast shadow, as a fraction of the background's brightness, where it is not
            measured.
        highlight: brightest reflection, as a fraction of the background's brightness.
        colours: least mean log odds that a colour is the person's (or is not), where the background
            does not decide.
        colours_gap: the same in narrow gaps of the silhouette.
        contrast: edges between colours closer than this (of 255) are not moved.
        min_area_share: components smaller than this fraction of the image are removed.
        min_body_share: components smaller than this fraction of the largest one are removed.
        max_hole_share: holes up to this fraction of the image are filled.
        possible_hole_share: the same where clothes may resemble the background.
    """

    chroma: float = 3.0
    possible: float = 1.2
    shaded: float = 3.0
    chroma_pixel: float = 6.0
    brightness: float = 8.0
    shadow: float = 0.5
    highlight: float = 1.1
    colours: float = 2.0
    colours_gap: float = 0.5
    contrast: float = 10.0
    min_area_share: float = 3e-4
    min_body_share: float = 0.01
    max_hole_share: float = 4e-5
    possible_hole_share: float = 2e-3


@dataclass(frozen=True, eq=False)
class Background:
    """Colours of the empty scene, and the scales of differences from them.

    Attributes:
        mean: (H, W, 3) float32, BGR of 255.
        planes: (3, H, W) float32, the same, channel by channel.
        scales: (3, H, W) float32: 1 / |mean|^2, 1 / noise, |mean| / noise.
    """

    mean: NDArray[np.float32]
    planes: NDArray[np.float32]
    scales: NDArray[np.float32]

    @classmethod
    def from_noise(cls, mean: NDArray[np.float32], noise: NDArray[np.floating]) -> "Background":
        """Background from the mean and each pixel's standard deviation (H, W), of 255."""
        square = np.maximum(np.square(mean, dtype=np.float64).sum(axis=2), 1.0)
        scales = np.stack([1 / square, 1 / noise, np.sqrt(square) / noise]).astype(np.float32)
        return cls(mean, np.ascontiguousarray(mean.transpose(2, 0, 1)), scales)

    def part(self, window: tuple[slice, slice]) -> "Background":
        """Background in a window of rows and columns."""
        planes, scales = (
            np.ascontiguousarray(array[:, *window]) for array in (self.planes, self.scales)
        )
        return Background(self.mean[window], planes, scales)


@dataclass(frozen=True, eq=False)
class Exposure:
    """How a whole frame differs from the background.

    Attributes:
        gain: (3,) float32, each channel's ratio of frame to background.
        noise: ratio of the frame's noise to the model's, at least 1.
    """

    gain: NDArray[np.float32]
    noise: float


@dataclass(frozen=True, eq=False)
class Trimap:
    """A silhouette, and what may belong to it.

    Attributes:
        silhouette: (H, W) bool.
        possible: (H, W) bool, the silhouette and where the colour's direction differs a little from
            the background's: clothes may resemble it.
        shaded: (H, W) bool, that and where the brightness differs: clothes, or a cast shadow.
    """

    silhouette: NDArray[np.bool_]
    possible: NDArray[np.bool_]
    shaded: NDArray[np.bool_]

    @classmethod
    def of(cls, silhouette: NDArray[np.bool_]) -> "Trimap":
        """Trimap of a silhouette (H, W) bool beside which nothing is possible."""
        return cls(silhouette, silhouette, silhouette)

    def __iter__(self) -> Iterator[NDArray[np.bool_]]:
        """Yields silhouette, possible and shaded."""
        return iter((self.silhouette, self.possible, self.shaded))


@dataclass(frozen=True, eq=False)
class _View:
    """A frame (H, W, 3), or a window of it, the same channel by channel (3, H, W), background, gain
    (3,), radius (px) and thresholds.
    """

    frame: NDArray[np.uint8]
    planes: NDArray[np.uint8]
    background: Background
    gain: NDArray[np.float32]
    radius: int
    settings: RefinedSettings

    @property
    def arrays(
        self,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """First arguments of the kernels; the gain is that from frame to background."""
        return (
            self.planes,
            self.background.planes,
            self.background.scales,
            np.asarray(1 / self.gain, np.float32),
        )

    def part(self, window: tuple[slice, slice]) -> "_View":
        return replace(
            self,
            frame=self.frame[window],
            planes=np.ascontiguousarray(self.planes[:, *window]),
            background=self.background.part(window),
        )


def refined_mask(
    frame: NDArray[np.uint8],
    background: Background,
    settings: RefinedSettings,
    region: NDArray[np.bool_] | None = None,
    exposure: Exposure | None = None,
    window: tuple[slice, slice] | None = None,
) -> NDArray[np.bool_]:
    """Silhouette (H, W) bool of a frame (H, W, 3) uint8 by the steps named above.

    Args:
        frame: the frame, or its part in the window.
        background: of the whole frame's size.
        settings: thresholds.
        region: (H, W) bool, where the person may be; None: everywhere.
        exposure: of the whole frame, by `measure_exposure`; None: measured here, on a whole frame.
        window: rows and columns outside of which nothing is looked for; None: the whole frame.
    """
    return _segmented(frame, background, settings, region, exposure, window)[0]


def refined_trimap(
    frame: NDArray[np.uint8],
    background: Background,
    settings: RefinedSettings,
    region: NDArray[np.bool_] | None = None,
) -> Trimap:
    """Silhouette as `refined_mask`, and what may belong to it."""
    exposure, radius = measure_exposure(frame, background, settings), _radius(background)
    silhouette, pooled = _segmented(frame, background, settings, region, exposure, None)
    bright = np.zeros(silhouette.shape, np.float32)
    hole = round(settings.possible_hole_share * bright.size)
    gap = np.ones((4 * radius + 1, 4 * radius + 1), np.uint8)

    def beyond_noise() -> NDArray[np.bool_]:
        differs = np.empty(silhouette.shape, np.bool_)
        limits = round(settings.possible * _UNIT), np.float32(settings.shaded * exposure.noise)
        kernels.doubt(pooled, bright, *limits, differs)
        # Averaging has widened it by the radius.
        found = silhouette | ~_grown(~differs, radius, cv2.MORPH_RECT)
        found = cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_CLOSE, gap).view(np.bool_)
        return clean(found, max_hole_px=hole, region=region)

    possible = beyond_noise()
    view = _View(frame, _planes(frame), background, exposure.gain, radius, settings)
    kernels.brightness(*view.arrays, bright)
    bright = np.asarray(cv2.blur(bright, (2 * radius + 1, 2 * radius + 1)), np.float32)
    return Trimap(silhouette, possible, beyond_noise())


def _segmented(
    frame: NDArray[np.uint8],
    background: Background,
    settings: RefinedSettings,
    region: NDArray[np.bool_] | None,
    exposure: Exposure | None,
    window: tuple[slice, slice] | None,
) -> tuple[NDArray[np.bool_], NDArray[np.int16]]:
    """Silhouette of `refined_mask`, and the pooled evidence (4, h, w) in the window."""
    everywhere = silhouette = np.zeros(background.mean.shape[:2], np.bool_)
    radius = _radius(background)
    gain = measure_gain(frame, background) if exposure is None else exposure.gain
    if window is not None:
        background = background.part(window)
        region = None if region is None else region[window]
        silhouette = silhouette[window]
    view = _View(frame, _planes(frame), background, gain, radius, settings)
    scale = _noise_scale(view) if exposure is None else exposure.noise
    mask, pooled = _detect(view, scale)
    mask = _clean(mask, settings, region, everywhere.size)
    if not mask.any():
        return everywhere, pooled
    box = _bounding_box(mask, margin=8 * radius)
    view, mask = view.part(box), mask[box]
    mask = _sharpen(view, mask)
    mask = _decide_by_colours(view, mask, np.ascontiguousarray(pooled[:, *box]), scale)
    mask = _sharpen(view, mask)
    region = None if region is None else region[box]
    silhouette[box] = _clean(mask, settings, region, everywhere.size)
    return everywhere, pooled


def measure_exposure(
    frame: NDArray[np.uint8], background: Background, settings: RefinedSettings
) -> Exposure:
    """Exposure of a whole frame (H, W, 3) uint8."""
    gain, radius = measure_gain(frame, background), _radius(background)
    view = _View(frame, _planes(frame), background, gain, radius, settings)
    return Exposure(gain, _noise_scale(view))


def count_shadows(
    frame: NDArray[np.uint8], background: Background, settings: RefinedSettings
) -> NDArray[np.int64]:
    """Histogram of the ratios of a frame's brightness to the background's, where only the
    brightness is lower and the colour's direction is the same: mostly cast shadows.

    Args:
        frame: (H, W, 3) uint8.
        background: of that size.
        settings: thresholds.

    Returns:
        (35,) int64, of ratios from 0.25 to 0.95.
    """
    exposure, radius = measure_exposure(frame, background, settings), _radius(background)
    view = _View(frame, _planes(frame), background, exposure.gain, radius, settings)
    _, pooled = _detect(view, exposure.noise)
    bright = np.empty(frame.shape[:2], np.float32)
    kernels.brightness(*view.arrays, bright)
    bright = cv2.blur(bright, (2 * radius + 1, 2 * radius + 1))
    limits = round(_SHADOW_CHROMA * _UNIT), np.float32(np.inf)
    coloured = np.empty(bright.shape, np.bool_)
    kernels.doubt(pooled, bright, *limits, coloured)
    dark = ~coloured & (bright < -_SHADOW_BRIGHTNESS * exposure.noise)
    inside = ~_grown(~dark, radius, cv2.MORPH_RECT)
    ratio = 1 + bright[inside] / background.scales[2][inside]
    return np.histogram(ratio, _SHADOW_EDGES)[0]


def darkest_shadow(counts: NDArray[np.int64]) -> float | None:
    """Ratio of brightness below which nothing is a cast shadow; None where there are too few.

    Args:
        counts: (35,) sum of what `count_shadows` gives for some frames and cameras.
    """
    if counts.sum() < _SHADOW_PIXELS:
        return None
    middles = 0.5 * (_SHADOW_EDGES[:-1] + _SHADOW_EDGES[1:])
    peak = middles[np.convolve(counts, np.ones(3), "same").argmax()]
    # The penumbra of a soft shadow has the peak, its core is darker.
    core = middles[np.searchsorted(np.cumsum(counts), _SHADOW_CORE * counts.sum())]
    lowest, usual, highest = _SHADOW_LIMITS
    below = peak - _SHADOW_MARGIN
    if below < usual:
        return max(lowest, float(below))
    return float(np.clip(min(below, core - _SHADOW_CORE_MARGIN), usual, highest))


def measure_gain(frame: NDArray[np.uint8], background: Background) -> NDArray[np.float32]:
    """Each channel's median ratio of frame to background, (3,) float32, over pixels neither black
    nor saturated.

    Args:
        frame: the whole frame, uint8, of the background's size or larger.
        background: of the empty scene.
    """
    height, width = background.mean.shape[:2]
    rows, columns = (
        ((np.arange(0, size, _GRID) + 0.5) * (full / size)).astype(int)
        for size, full in zip((height, width), frame.shape[:2], strict=True)
    )
    observed = frame[rows[:, None], columns].reshape(-1, 3)
    empty = background.mean[::_GRID, ::_GRID].reshape(-1, 3)
    gain = np.ones(3, np.float32)
    for channel in range(3):
        before, after = empty[:, channel], observed[:, channel]
        valid = (before > 16) & (before < 235) & (after < 250)
        if valid.sum() >= 16:
            # The median; NumPy's own takes four times as long for so few.
            ratios = np.sort(after[valid] / before[valid])
            gain[channel] = (ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2]) / 2
    return np.clip(gain, 0.5, 2.0)


def _radius(background: Background) -> int:
    """Half width of the window over which evidence is pooled, px."""
    return max(1, round(min(background.mean.shape[:2]) / 240))


def _planes(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.split(frame), np.uint8)


def _noise_scale(view: _View) -> float:
    """Ratio of the frame's noise to the model's, at least 1."""
    height, width = view.frame.shape[:2]
    sampled = np.empty((-(-height // _GRID), -(-width // _GRID)), np.float32)
    clip = np.float32(view.settings.chroma_pixel)
    kernels.sampled_chroma(*view.arrays, clip, view.radius, _GRID, sampled)
    return max(1.0, float(np.median(sampled)) / _USUAL_CHROMA)


def _detect(view: _View, scale: float) -> tuple[NDArray[np.bool_], NDArray[np.int16]]:
    """Mask (H, W) and pooled evidence (4, H, W) in 1 / _UNIT of the frame's noise."""
    settings, radius = view.settings, view.radius
    height, width = view.frame.shape[:2]
    parts, strong = np.empty((4, height, width), np.int16), np.empty((height, width), np.bool_)
    unit, clip, beyond = (
        np.float32(value)
        for value in (_UNIT / scale, settings.chroma_pixel * scale, settings.brightness * scale)
    )
    kernels.evidence(
        *view.arrays,
        unit,
        clip,
        np.float32(settings.shadow),
        np.float32(settings.highlight),
        beyond,
        parts,
        strong,
    )
    pooled = np.asarray(
        [cv2.blur(part, (2 * radius + 1, 2 * radius + 1)) for part in parts], np.int16
    )
    mask = np.empty((height, width), np.bool_)
    kernels.decide(
        pooled, strong, round(settings.chroma * _UNIT), round(settings.brightness * _UNIT), mask
    )
    return mask, pooled


def _decide_by_colours(
    view: _View, mask: NDArray[np.bool_], pooled: NDArray[np.int16], scale: float
) -> NDArray[np.bool_]:
    """Mask in which the colours inside and around the silhouette decide the doubtful pixels."""
    settings, radius = view.settings, view.radius
    near = _grown(mask, 7 * radius, cv2.MORPH_RECT)
    odds = _log_fractions(view.frame, ~_grown(~mask, 1)) - _log_fractions(
        view.frame, near & ~_grown(mask, 2)
    )
    score, bright = np.empty(mask.shape, np.float32), np.empty(mask.shape, np.float32)
    kernels.look_up(view.frame, np.clip(odds, -4, 4), _COLOUR_SHIFT, score)
    kernels.brightness(*view.arrays, bright)
    # Background of the usual brightness that was included because of subsampled colour.
    surplus = (cv2.blur(score, (3, 3)) < -settings.colours) & (
        np.abs(cv2.blur(bright, (3, 3))) < 3 * scale
    )
    window = (2 * radius + 1, 2 * radius + 1)
    score, bright = cv2.blur(score, window), cv2.blur(bright, window)
    # The person where the difference is as small as a shadow's ...
    doubtful = np.empty(mask.shape, np.bool_)
    kernels.doubt(
        pooled, bright, round(0.5 * settings.chroma * _UNIT), np.float32(3 * scale), doubtful
    )
    # ... or in a narrow gap of the silhouette, where clothes and background may be of one colour.
    gap = ~_grown(~_grown(mask, 4 * radius, cv2.MORPH_RECT), 4 * radius, cv2.MORPH_RECT)
    added = near & (
        (doubtful & (score > settings.colours)) | (gap & (score > settings.colours_gap))
    )
    return (mask & ~surplus) | added


def _log_fractions(frame: NDArray[np.uint8], where: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Logarithm of each colour's fraction of the pixels of a mask, (16, 16, 16)."""
    bins = 256 >> _COLOUR_SHIFT
    counts, fractions = (np.zeros((bins, bins, bins), np.float32) for _ in range(2))
    kernels.count_colours(frame, where, _COLOUR_SHIFT, counts)
    kernels.log_fractions(counts, fractions)
    return fractions


def _sharpen(view: _View, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask with edges moved by at most `radius` pixels, to where person and background each make up
    half of a pixel.
    """
    radius = view.radius
    grown, shrunk = _grown(mask, radius), ~_grown(~mask, radius)
    gap = max(1, radius // 2)  # pixels at the edge are mixed: they show neither colour
    inside, outside = ~_grown(~mask, gap), ~_grown(mask, gap)
    moved = mask.copy()
    light = 0.2 * view.gain, 2 * view.gain  # largest effect of shadows and reflections
    images = view.planes, view.background.planes
    regions = grown & ~shrunk, inside, outside
    contrast = np.float32(view.settings.contrast)
    kernels.sharpen(*images, *light, *regions, 2 * radius, contrast, moved)
    return moved


def _grown(
    mask: NDArray[np.bool_], pixels: int, shape: int = cv2.MORPH_ELLIPSE
) -> NDArray[np.bool_]:
    """Mask (H, W) dilated by a number of pixels."""
    disc = cv2.getStructuringElement(shape, (2 * pixels + 1, 2 * pixels + 1))
    return np.asarray(cv2.dilate(mask.view(np.uint8), disc), np.uint8).view(np.bool_)


def _clean(
    mask: NDArray[np.bool_],
    settings: RefinedSettings,
    region: NDArray[np.bool_] | None,
    pixels: int,
) -> NDArray[np.bool_]:
    """Mask (H, W) without the components and holes that are small for an image of `pixels`."""
    area, hole = round(settings.min_area_share * pixels), round(settings.max_hole_share * pixels)
    return clean(
        mask, min_area_px=area, min_share=settings.min_body_share, max_hole_px=hole, region=region
    )


def _bounding_box(mask: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """Rows and columns of the mask's bounding box and a margin."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(int(rows[0]) - margin, 0), min(int(rows[-1]) + margin + 1, mask.shape[0])),
        slice(max(int(columns[0]) - margin, 0), min(int(columns[-1]) + margin + 1, mask.shape[1])),
    )
