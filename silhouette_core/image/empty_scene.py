"""The empty scene from frames in which a person is always somewhere (background initialisation).

The median over time is the background where it is seen in more than half of the frames. Whoever
stands still or moves little is in the median. So, where the frames differ from each other:

1. each pixel's colours over time are grouped into modes, of which one is the background, however
   rarely it is seen;
2. beginning at the pixels that never change, each pixel gets the mode that continues the colours
   beside it best, and is seen in the same frames (paths of least cost);
3. regions that are reached only over a large step were never seen empty, if that step moves: the
   pixel before it shows at other times what is behind it. The colours around such a region are
   continued into it (`cv2.inpaint`, Telea), and its noise is that of a guess. Furniture lies
   behind steps that do not move.

This project's extension of Okada and Stenger's section 5.1.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.components import label_components
from silhouette_core.image.difference import Background, measure_gain
from silhouette_core.image.kernels import background as medians
from silhouette_core.image.kernels import empty_scene as kernels
from silhouette_core.tuning import SCENE

_MODES = 5


@dataclass(frozen=True, eq=False)
class EmptyScene:
    """Estimate of the empty scene.

    Attributes:
        mean: (H, W, 3) float32, BGR of 255.
        variance: (H, W, 3) float32.
        unseen: (H, W) bool, where the background was never seen and the colours around it are
            continued.
    """

    mean: NDArray[np.float32]
    variance: NDArray[np.float32]
    unseen: NDArray[np.bool_]

    @classmethod
    def from_frames(cls, stack: NDArray[np.uint8]) -> "EmptyScene":
        """Estimate from frames (T, H, W, 3) uint8, BGR, spread over a recording, T at most 64."""
        stack = stack[:64]
        median, deviation = (np.empty(stack.shape[1:], np.float32) for _ in range(2))
        medians.median_and_deviation(stack, median, deviation)
        # The standard deviation of a Gaussian is so many of its median distances from the mean.
        variance = np.square(1.4826 * deviation)
        nowhere = np.zeros(median.shape[:2], np.bool_)
        background = Background.from_noise(median, np.ones(nowhere.shape))
        gains = np.stack([measure_gain(frame, background) for frame in stack])
        changed, noise = _changed(stack, gains, median)
        rows, columns = np.nonzero(changed)
        if not len(rows) or changed.all():
            return cls(median, variance, nowhere)
        window = slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)
        # One more pixel on each side, from which the background is continued.
        window = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in window)
        inside, smooth = changed[window], _smooth(stack[:, *window], gains)
        modes = _Modes.of(smooth, inside, SCENE.changed * noise)
        colour = np.asarray(cv2.blur(median[window], (3, 3)), np.float32)
        step = np.zeros(inside.shape, np.float32)
        every = np.uint64((1 << len(stack)) - 1)
        limits = SCENE.tolerance * noise, SCENE.apart, SCENE.rarity
        kernels.grow_background(
            colour, inside, modes.index, modes.mean, modes.share, modes.shown, every, limits, step
        )
        seen = _mean_of_mode(stack[:, *window], gains, smooth, colour, SCENE.changed * noise)
        unseen = nowhere.copy()
        behind = _behind_moving_edges(
            colour, step > SCENE.step * noise, modes, SCENE.changed * noise
        )
        unseen[window] = _opened(behind & inside, _radius(median))
        median[window][inside] = seen[inside]
        variance[changed] = np.median(variance)  # that of the median includes the person
        guess = cv2.inpaint(
            np.rint(median.clip(0, 255)).astype(np.uint8),
            unseen.view(np.uint8),
            5,
            cv2.INPAINT_TELEA,
        )
        median[unseen], variance[unseen] = guess[unseen], SCENE.guess**2
        return cls(median, variance, unseen)


def _radius(image: NDArray) -> int:
    return max(1, round(min(image.shape[:2]) / 240))


def _smooth(stack: NDArray[np.uint8], gains: NDArray[np.float32]) -> NDArray[np.float32]:
    """Frames (T, H, W, 3) averaged over 3 by 3 pixels, with the background's exposure."""
    return np.stack(
        [cv2.blur(frame, (3, 3)) / gain for frame, gain in zip(stack, gains, strict=True)]
    )


def _changed(
    stack: NDArray[np.uint8], gains: NDArray[np.float32], median: NDArray[np.float32]
) -> tuple[NDArray[np.bool_], float]:
    """Regions (H, W) in which frames differ from the median, made convex, and the noise: the
    median of the differences, summed over the channels.
    """
    highest, second = (np.zeros(median.shape[:2], np.float32) for _ in range(2))
    usual = []
    smooth_median = cv2.blur(median, (3, 3))
    for frame, gain in zip(stack, gains, strict=True):
        difference = np.abs(cv2.blur(frame, (3, 3)) / gain - smooth_median).sum(axis=2)
        usual.append(np.median(difference))
        # A single frame that differs may be a flash; two are a person.
        second = np.maximum(second, np.minimum(highest, difference))
        highest = np.maximum(highest, difference)
    noise = max(float(np.median(usual)), 0.5)
    radius = _radius(median)
    near = cv2.dilate((second > SCENE.changed * noise).view(np.uint8), _square(2 * radius + 1))
    joined = label_components(
        cv2.morphologyEx(near, cv2.MORPH_CLOSE, _square(10 * radius + 1)).view(np.bool_)
    )
    large = joined.sizes >= SCENE.small * second.size
    large[0] = False
    return _convex(large[joined.labels]), noise


def _convex(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Convex hulls of the mask's (H, W) components: of somebody who stands, the legs do not move
    between the feet and the trunk.
    """
    outlines, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    filled = np.zeros(mask.shape, np.uint8)
    for outline in outlines:
        cv2.fillConvexPoly(filled, cv2.convexHull(outline), 1)
    return filled.view(np.bool_)


def _opened(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Mask without what is thin, widened by what a blurred edge mixes."""
    kept = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, _square(3))
    return np.asarray(cv2.dilate(kept, _square(3 * radius + 1))).view(np.bool_)


def _square(side: int) -> NDArray[np.uint8]:
    return np.ones((side, side), np.uint8)


@dataclass(frozen=True, eq=False)
class _Modes:
    """Modes of the colour over time of n pixels.

    Attributes:
        index: (h, w) int32, numbers of the pixels; -1: not among them.
        mean: (n, K, 3) float32.
        share: (n, K) float32 of the frames; 0: no mode.
        shown: (n, K) uint64, bit t: whether frame t shows the mode.
    """

    index: NDArray[np.int32]
    mean: NDArray[np.float32]
    share: NDArray[np.float32]
    shown: NDArray[np.uint64]

    @classmethod
    def of(cls, smooth: NDArray[np.float32], inside: NDArray[np.bool_], radius: float) -> "_Modes":
        """Modes of frames (T, h, w, 3) inside a region (h, w)."""
        rows, columns = np.nonzero(inside)
        index = np.full(inside.shape, -1, np.int32)
        index[rows, columns] = np.arange(len(rows))
        mean = np.empty((len(rows), _MODES, 3), np.float32)
        share = np.empty((len(rows), _MODES), np.float32)
        samples = np.ascontiguousarray(smooth[:, rows, columns])
        shown = np.zeros(share.shape, np.uint64)
        kernels.colour_modes(samples, np.float32(radius), mean, share, shown)
        # What is seen once is a mixture: the edge of somebody in motion.
        share[(share < SCENE.seen) & (np.arange(_MODES) > 0)] = 0
        return cls(index, mean, share, shown)


def _behind_moving_edges(
    colour: NDArray[np.float32], beyond: NDArray[np.bool_], modes: _Modes, radius: float
) -> NDArray[np.bool_]:
    """Components (h, w) of what lies beyond a large step whose edge moves: where the pixel before
    it has a mode of the colour behind it.
    """
    moving = np.zeros_like(beyond)
    height, width = beyond.shape
    for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        rows = slice(max(-down, 0), height - max(down, 0))
        columns = slice(max(-right, 0), width - max(right, 0))
        before = slice(max(down, 0), height + min(down, 0))
        beside = slice(max(right, 0), width + min(right, 0))
        index = modes.index[before, beside]
        behind = colour[rows, columns]
        edge = beyond[rows, columns] & (index >= 0)
        edge &= np.abs(behind - colour[before, beside]).sum(axis=2) > radius
        at = index[edge]
        near = np.abs(modes.mean[at] - behind[edge][:, None]).sum(axis=2) < radius
        moving[rows, columns][edge] |= (near & (modes.share[at] > 0)).any(axis=1)
    components = label_components(beyond)
    inner = cv2.erode(beyond.view(np.uint8), _square(3)).view(np.bool_)
    count = len(components.sizes)
    edges = np.bincount(components.labels[beyond & ~inner], minlength=count)
    moved = np.bincount(components.labels[moving], minlength=count)
    found = moved > SCENE.moving * np.maximum(edges, 1)
    found[0] = False
    return found[components.labels]


def _mean_of_mode(
    stack: NDArray[np.uint8],
    gains: NDArray[np.float32],
    smooth: NDArray[np.float32],
    colour: NDArray[np.float32],
    radius: float,
) -> NDArray[np.float32]:
    """Mean (h, w, 3) of the frames that show the mode of a colour, as sharp as they are."""
    count, total = np.zeros((*colour.shape[:2], 1)), np.zeros(colour.shape)
    for frame, gain, blurred in zip(stack, gains, smooth, strict=True):
        near = (np.abs(blurred - colour).sum(axis=2) < radius)[..., None]
        count, total = count + near, total + near * (frame / gain)
    return np.where(count > 0, total / np.maximum(count, 1), colour).astype(np.float32)
