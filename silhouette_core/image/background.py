"""The empty scene of one fixed camera, and what differs from it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.image.foreground import Background, RefinedSettings, refined_mask
from silhouette_core.image.kernels import background as kernels

_PRIOR_FRAMES = 10  # how many frames the assumed noise is worth against the measured one


@dataclass(frozen=True)
class BackgroundSettings:
    """What decides between person and background; one set serves all cameras.

    Attributes: method: "paper" is Okada and Stenger's section 5.1 as written, without any clean-up;
        "refined" is what
            `silhouette_core.image.foreground` makes of it.
        noise: least standard deviation of a colour channel (of 255); also what is assumed for a
            still.
        log_likelihood: the paper's threshold, as the logarithm of the density of the normalised
            colour.
        raw_difference: the paper's clear difference: length of the difference of raw colours (of
            255).
        refined: thresholds of the refined method.
    """

    method: Literal["refined", "paper"] = "refined"
    noise: float = 1.0
    log_likelihood: float = -30.0
    raw_difference: float = 90.0
    refined: RefinedSettings = field(default_factory=RefinedSettings)


@dataclass(frozen=True, eq=False)
class _Learnt:
    """Per pixel and channel (H, W, 3): mean and variance of the colour, mean and variance of the
    colour over its length.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    unit_mean: NDArray[np.float64]
    unit_variance: NDArray[np.float64]


class BackgroundModel:
    """Background of one camera. Make it with `from_frames`, `from_still` or `from_median`.

    Source: Okada and Stenger, section 5.1, for the Gaussian over a colour divided by its length,
    and the clear difference of colours.
    Beyond the paper: `from_still`, `from_median`, the least noise, and all of the refined method.
    """

    def __init__(self, learnt: _Learnt, settings: BackgroundSettings | None = None):
        """Keeps what was learnt; see the constructors `from_...`."""
        self.settings = settings or BackgroundSettings()
        self.mean: NDArray[np.float32] = np.ascontiguousarray(learnt.mean, np.float32)
        noise = np.maximum(np.sqrt(learnt.variance.mean(axis=2)), self.settings.noise)
        self._background = Background.from_noise(self.mean, noise)
        # Noise of the raw channels turns a colour of length L by noise / L: dark pixels have no
        # sure direction.
        length = np.maximum(np.linalg.norm(learnt.mean, axis=2, keepdims=True), 1.0)
        variance = np.maximum(learnt.unit_variance, (self.settings.noise / length) ** 2)
        self._unit_mean = np.ascontiguousarray(learnt.unit_mean, np.float32)
        self._half_precision = np.ascontiguousarray(0.5 / variance, np.float32)
        self._log_peak = np.ascontiguousarray(
            -0.5 * np.log(2 * np.pi * variance).sum(axis=2), np.float32
        )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.mean.shape[1], self.mean.shape[0]

    @classmethod
    def from_frames(
        cls, frames: Iterable[np.ndarray], settings: BackgroundSettings | None = None
    ) -> "BackgroundModel":
        """Learns from pictures of the empty scene, one after the other.

        Args:
            frames: each (H, W, 3) uint8, BGR; at least one.
            settings: thresholds; None for the defaults.

        Raises:
            ValueError: no frame, a frame is not (H, W, 3), or frames of different size.
            TypeError: a frame is not uint8.
        """
        count = 0
        sums: list[np.ndarray] = []
        for frame in frames:
            check_array("frame", frame, sums[0].shape if sums else ("H", "W", 3), np.uint8)
            if not sums:
                sums = [np.zeros(frame.shape) for _ in range(4)]
            kernels.add_moments(np.ascontiguousarray(frame), *sums)
            count += 1
        if not count:
            raise ValueError("frames must hold at least one picture of the empty scene, got none")
        mean, square, unit_mean, unit_square = (total / count for total in sums)
        assumed = (settings or BackgroundSettings()).noise ** 2
        variance = (count * np.maximum(square - mean**2, 0) + _PRIOR_FRAMES * assumed) / (
            count + _PRIOR_FRAMES
        )
        return cls(
            _Learnt(mean, variance, unit_mean, np.maximum(unit_square - unit_mean**2, 0)), settings
        )

    @classmethod
    def from_still(
        cls, frame: np.ndarray, settings: BackgroundSettings | None = None
    ) -> "BackgroundModel":
        """Learns from one picture of the empty scene, (H, W, 3) uint8, BGR; the noise is assumed
        (`settings.noise`).
        """
        return cls.from_frames([frame], settings)

    @classmethod
    def from_median(
        cls, frames: Iterable[np.ndarray], settings: BackgroundSettings | None = None
    ) -> "BackgroundModel":
        """Learns from pictures in which the person moves about: the median over time of every
        pixel.

        Right where each place is empty more than half of the time; who stands still becomes
        background.

        Args: frames: each (H, W, 3) uint8, BGR; all are held in memory, so give a sample (some 50
            over the recording). settings: thresholds; None for the defaults.

        Raises:
            ValueError: no frame, a frame is not (H, W, 3), or frames of different size.
            TypeError: a frame is not uint8.
        """
        stack: list[np.ndarray] = []
        for frame in frames:
            check_array("frame", frame, stack[0].shape if stack else ("H", "W", 3), np.uint8)
            stack.append(frame)
        if not stack:
            raise ValueError("frames must hold at least one picture, got none")
        median, deviation = (
            np.empty(stack[0].shape, np.float32),
            np.empty(stack[0].shape, np.float32),
        )
        kernels.median_and_deviation(np.stack(stack), median, deviation)
        mean = median.astype(np.float64)
        length = np.maximum(np.linalg.norm(mean, axis=2, keepdims=True), 1.0)
        variance = np.square(
            1.4826 * deviation, dtype=np.float64
        )  # a Gaussian's median distance is 0.6745 standard deviations
        return cls(_Learnt(mean, variance, mean / length, variance / length**2), settings)

    def silhouette(self, frame: np.ndarray, region: np.ndarray | None = None) -> np.ndarray:
        """Returns what does not belong to the background.

        Args:
            frame: (H, W, 3) uint8, BGR, of the model's size.
            region: region of interest, (H, W) bool; None means the whole image.

        Returns:
            Silhouette, (H, W) bool.

        Raises:
            ValueError: the frame has another size than the background.
            TypeError: the frame is not uint8.
        """
        check_array("frame", frame, self.mean.shape, np.uint8)
        frame = np.ascontiguousarray(frame)
        if self.settings.method == "refined":
            return refined_mask(frame, self._background, self.settings.refined, region)
        mask = np.empty(frame.shape[:2], np.bool_)
        limits = np.float32(self.settings.log_likelihood), np.float32(self.settings.raw_difference)
        kernels.paper_mask(
            frame, self.mean, self._unit_mean, self._half_precision, self._log_peak, *limits, mask
        )
        return mask if region is None else mask & region
