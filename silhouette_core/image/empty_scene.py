"""The empty scene from frames in which a person is always somewhere (background initialisation).

Each pixel's colours over time are grouped into modes, of which one is the background, however
rarely it is seen, or none, if somebody is always before it. Labels of all pixels are chosen
together, so that

1. the frames show the background as often as possible,
2. no edge of the background moves: where a colour ends beside another, neither of the two pixels
   shows the other's colour at other times. Outlines of people do, those of furniture do not,
3. what was never seen is small, and beside it nothing is gained by a thin rim,
4. it is not shown where somebody is in front of it: in the convex hull of all that differs from the
   background in a frame. Of who stays in place, limbs move, and the trunk between them does not,
5. before a uniform backdrop (`image.backdrop`) it is the backdrop's colour, or was never seen.

The hulls come from labels that are first chosen without them. All frames are given the same
exposure. The colours around what was never seen are continued into it (`cv2.inpaint`, Telea), with
the noise of a guess.

This project's extension of Okada and Stenger's section 5.1. Background estimation as a labelling
problem: Cohen (ICCV 2005), with another cost of steps.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, Float32Array
from silhouette_core.image.backdrop import backdrop_of, only_shaded, tolerance
from silhouette_core.image.cleanup import clean, opened
from silhouette_core.image.exposure import Aligner
from silhouette_core.image.kernels import backgrounds as kernels
from silhouette_core.tuning import SCENE

Kind = Literal["auto", "uniform", "moving"]
"""What an empty scene is taken from, see `silhouette_core.estimator.BackgroundKind`."""
_MODES, _ROUNDS = 5, 12


@dataclass(frozen=True, eq=False)
class EmptyScene:
    """Estimate of the empty scene."""

    mean: Float32Array  #: (H, W, 3) float32, BGR of 255.
    variance: Float32Array  #: (H, W, 3) float32.
    unseen: BoolArray
    """(H, W) bool, where the background was never seen and the colours around it are continued."""
    frames: ByteArray  #: (T, H, W, 3) uint8, the frames with the exposure of the mean.
    uniform: bool = False  #: whether a uniform backdrop was found.

    @classmethod
    def from_frames(
        cls, stack: ByteArray, people: BoolArray | None = None, kind: Kind = "auto"
    ) -> "EmptyScene":
        """Estimate from frames (T, H, W, 3) uint8, BGR, spread over a recording, T at most 64;
        where they are known to show people, (T, H, W), they do not show the scene. A uniform
        backdrop is looked for (`auto`), is there in any case (`uniform`), or is not looked for.
        """
        stack = stack[:64]
        median = np.empty(stack.shape[1:], np.float32)
        kernels.median(stack, median)
        aligner = Aligner(median)
        frames = np.stack([aligner.aligned(frame) for frame in stack])
        height, width = stack.shape[1:3]
        factor = min(1.0, SCENE.side_px / min(height, width))
        size = max(round(width * factor), 1), max(round(height * factor), 1)
        small = [cv2.resize(frame, size, interpolation=cv2.INTER_AREA) for frame in frames]
        rows, columns = np.arange(height) * size[1] // height, np.arange(width) * size[0] // width
        samples, hidden = np.stack(small).astype(np.float32), np.zeros(size[::-1], np.uint64)
        if people is not None:
            samples, hidden = _without_people(samples, people[: len(stack)])
        radius = _radius(samples)
        backdrop = None if kind == "moving" else backdrop_of(samples, radius, kind == "uniform")
        moments = (_background_frames(samples, radius, backdrop) & ~hidden)[np.ix_(rows, columns)]
        mean, variance = _moments(frames, moments)
        unseen = moments == 0
        variance = np.maximum(variance, SCENE.least_sigma**2)
        mean[unseen] = cv2.inpaint(
            np.rint(mean.clip(0, 255)).astype(np.uint8), unseen.view(np.uint8), 5, cv2.INPAINT_TELEA
        )[unseen]
        variance[unseen] = SCENE.guess**2
        if backdrop is not None:
            field = np.asarray(cv2.resize(backdrop[0], (width, height)), np.float32)
            shaded = unseen & only_shaded(median, field, radius)
            mean[shaded], unseen = field[shaded], unseen & ~shaded
        return cls(mean, variance, unseen, frames, backdrop is not None)


def _without_people(
    samples: Float32Array, people: BoolArray
) -> tuple[Float32Array, NDArray[np.uint64]]:
    """Samples (T, h, w, 3) with the median of a pixel's others where they show people (T, H, W);
    and when each shows people, (h, w), bit t at moment t.
    """
    size, masks = samples.shape[2:0:-1], people.astype(np.float32)
    small = np.stack([cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in masks]) > 0
    scene = np.ma.median(np.ma.array(samples, mask=np.repeat(small[..., None], 3, 3)), axis=0)
    known = ~np.ma.getmaskarray(scene)
    bits = np.uint64(1) << np.arange(len(samples), dtype=np.uint64)
    hidden = np.bitwise_or.reduce(np.where(small, bits[:, None, None], np.uint64(0)), axis=0)
    filled = samples.copy()
    np.copyto(filled, np.ma.getdata(scene), where=small[..., None] & known)
    return filled, hidden


def _radius(samples: Float32Array) -> float:
    """Difference from noise on of samples (T, h, w, 3), summed over the channels, grey levels."""
    median = np.median(samples, axis=0)
    usual = [float(np.median(np.abs(frame - median).sum(axis=2))) for frame in samples]
    return SCENE.changed * max(float(np.median(usual)), SCENE.least_noise)


def _background_frames(
    small: Float32Array, radius: float, backdrop: tuple[Float32Array, BoolArray] | None
) -> NDArray[np.uint64]:
    """Frames that show the background of each pixel, (h, w): bit t for frame t; 0: none does."""
    count, height, width = small.shape[:3]
    pixels = height * width
    mean = np.empty((pixels, _MODES, 3), np.float32)
    share = np.empty((pixels, _MODES), np.float32)
    moments = np.zeros((pixels, _MODES), np.uint64)
    kernels.colour_modes(small.reshape(count, pixels, 3), np.float32(radius), mean, share, moments)
    # What is seen once is a mixture: the edge of somebody in motion.
    share[(np.rint(share * count) < 2) & (np.arange(_MODES) > 0)] = 0
    mean, share = mean.reshape(height, width, _MODES, 3), share.reshape(height, width, _MODES)
    costs = np.full((height, width, _MODES + 1), SCENE.hidden * SCENE.unseen, np.float32)
    costs[..., :-1] = np.where(share > 0, SCENE.hidden * (1 - share), np.inf)
    right, down = (np.zeros((height, width, _MODES + 1, _MODES + 1), np.float32) for _ in range(2))
    still, border = np.float32(SCENE.still), np.float32(SCENE.border)
    kernels.step_costs(mean, share, np.float32(radius), still, border, right, down)
    frames = np.append(moments, np.zeros((pixels, 1), np.uint64), axis=1)
    labels = np.empty((height, width), np.int64)

    def chosen() -> NDArray[np.uint64]:
        kernels.least_cost_labels(costs, right, down, _ROUNDS, labels)
        return np.take_along_axis(frames, labels.reshape(-1, 1), axis=1).reshape(height, width)

    if backdrop is not None:
        field, before = backdrop
        strange = np.abs(mean - field[:, :, None]).sum(axis=3) > tolerance(radius)
        of_field = np.where(strange | np.isinf(costs[..., :-1]), np.inf, 0)
        costs[before, :-1] = of_field[before]
        return chosen()
    hidden = _hidden(chosen(), moments.reshape(height, width, _MODES), count)
    costs[..., :-1] += SCENE.hidden * hidden
    return chosen()


def _hidden(
    background: NDArray[np.uint64], moments: NDArray[np.uint64], count: int
) -> Float32Array:
    """Share (h, w, K) of the frames in which a mode is shown by somebody in front of the
    background, as far as somebody always is.

    Args:
        background: (h, w), bit t for frame t, which shows it; 0: none does.
        moments: (h, w, K), likewise of each mode.
        count: number of frames.
    """
    always = np.zeros(background.shape, np.float32)
    hidden = np.zeros(moments.shape, np.float32)
    for frame in np.arange(count, dtype=np.uint64):
        differs = ((background >> frame) & np.uint64(1) == 0) & (background > 0)
        pieces = clean(opened(differs, 3), min_share=SCENE.piece)
        hull = np.zeros(pieces.shape, np.uint8)
        if pieces.any():
            cv2.fillConvexPoly(hull, cv2.convexHull(np.argwhere(pieces)[:, ::-1]), 1)
        always += hull / count
        hidden += ((moments >> frame) & np.uint64(1)) * hull[..., None] / np.float32(count)
    return np.asarray(hidden * (always**SCENE.always)[..., None], np.float32)


def _moments(frames: ByteArray, moments: NDArray[np.uint64]) -> tuple[Float32Array, Float32Array]:
    """Mean and variance (H, W, 3) of the frames (T, H, W, 3) that show the background (H, W)."""
    count = np.zeros((*moments.shape, 1), np.float32)
    total, squares = (np.zeros(frames.shape[1:], np.float32) for _ in range(2))
    for number, frame in enumerate(frames):
        seen = ((moments >> np.uint64(number)) & np.uint64(1)).astype(np.float32)[..., None]
        count += seen
        total += seen * frame
        squares += seen * np.square(frame, dtype=np.float32)
    mean = np.asarray(total / np.maximum(count, 1), np.float32)
    variance = np.maximum(squares / np.maximum(count, 1) - mean**2, 0)
    return mean, np.asarray(variance, np.float32)
