"""The empty scene of one fixed camera, and what differs from it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from silhouette_core.image import cleanup
from silhouette_core.image.kernels import background as kernels


@dataclass(frozen=True)
class BackgroundSettings:
    """What decides between person and background; one set serves all cameras.

    Attributes:
        method: "paper" is Okada and Stenger's section 5.1 as written, without any clean-up.
        log_likelihood: the paper's threshold, as the logarithm of the density of the normalised colour.
        raw_difference: length of the difference of raw colours (of 255) that is foreground whatever its direction.
        noise: least standard deviation of a colour channel (of 255); also what is assumed for a still.
        min_area_share: components smaller than this share of the image are dropped.
        max_hole_share: holes up to this share of the image are filled.
    """

    method: Literal["refined", "paper"] = "refined"
    log_likelihood: float = -8.0
    raw_difference: float = 90.0
    noise: float = 1.5
    min_area_share: float = 3e-4
    max_hole_share: float = 3e-5


class BackgroundModel:
    """Background of one camera: per pixel the mean colour and a Gaussian over the colour's direction.

    Make it with `from_frames`, `from_still` or `from_median`.

    Source: Okada and Stenger, section 5.1.
    """

    def __init__(self, mean: np.ndarray, unit_mean: np.ndarray, unit_variance: np.ndarray, settings: BackgroundSettings | None = None):
        """Keeps the Gaussians.

        Args:
            mean: mean colour, (H, W, 3), BGR of 255.
            unit_mean: mean of the colour divided by its length, (H, W, 3).
            unit_variance: variances of the same, (H, W, 3); raised to what `settings.noise` causes.
            settings: thresholds; None for the defaults.
        """
        self.settings = settings or BackgroundSettings()
        self.mean = np.ascontiguousarray(mean, np.float32)
        self.unit_mean = np.ascontiguousarray(unit_mean, np.float32)
        # Noise of the raw channels turns a colour of length L by noise / L: dark pixels have no sure direction.
        length = np.maximum(np.linalg.norm(mean, axis=2, keepdims=True), 1.0)
        variance = np.maximum(unit_variance, (self.settings.noise / length) ** 2)
        self._half_precision = np.ascontiguousarray(0.5 / variance, np.float32)
        self._log_peak = np.ascontiguousarray(-0.5 * np.log(2 * np.pi * variance).sum(axis=2), np.float32)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.mean.shape[1], self.mean.shape[0]

    @classmethod
    def from_frames(cls, frames: Iterable[np.ndarray], settings: BackgroundSettings | None = None) -> "BackgroundModel":
        """Learns from pictures of the empty scene, one after the other.

        Args:
            frames: each (H, W, 3) uint8, BGR; at least one.
            settings: thresholds; None for the defaults.

        Raises:
            ValueError: no frame, or frames of different size.
            TypeError: a frame is not (H, W, 3) uint8.
        """
        count = 0
        sums: list[np.ndarray] = []
        for frame in frames:
            _check(frame, sums[0].shape if sums else None)
            if not sums:
                sums = [np.zeros(frame.shape) for _ in range(3)]
            kernels.add_moments(np.ascontiguousarray(frame), *sums)
            count += 1
        if not count:
            raise ValueError("frames must hold at least one picture of the empty scene, got none")
        mean, unit_mean, unit_square = (total / count for total in sums)
        return cls(mean, unit_mean, np.maximum(unit_square - unit_mean**2, 0), settings)

    @classmethod
    def from_still(cls, frame: np.ndarray, settings: BackgroundSettings | None = None) -> "BackgroundModel":
        """Learns from one picture of the empty scene, (H, W, 3) uint8, BGR; the noise is assumed (`settings.noise`)."""
        return cls.from_frames([frame], settings)

    @classmethod
    def from_median(cls, frames: Iterable[np.ndarray], settings: BackgroundSettings | None = None) -> "BackgroundModel":
        """Learns from pictures in which the person moves about: the median over time of every pixel.

        Right where each place is empty more than half of the time; who stands still becomes background.

        Args:
            frames: each (H, W, 3) uint8, BGR; all are held in memory, so give a sample (some 50 over the recording).
            settings: thresholds; None for the defaults.

        Raises:
            ValueError: no frame, or frames of different size.
            TypeError: a frame is not (H, W, 3) uint8.
        """
        stack: list[np.ndarray] = []
        for frame in frames:
            _check(frame, stack[0].shape if stack else None)
            stack.append(frame)
        if not stack:
            raise ValueError("frames must hold at least one picture, got none")
        return cls.from_still(_median(np.stack(stack)), settings)

    def silhouette(self, frame: np.ndarray, region: np.ndarray | None = None) -> np.ndarray:
        """Returns what does not belong to the background.

        Args:
            frame: (H, W, 3) uint8, BGR, of the model's size.
            region: region of interest, (H, W) bool; None means the whole image.

        Returns:
            Silhouette, (H, W) bool.

        Raises:
            ValueError: a frame of another size.
            TypeError: frame is not (H, W, 3) uint8.
        """
        _check(frame, self.mean.shape)
        settings = self.settings
        mask = self._paper(np.ascontiguousarray(frame))
        if settings.method == "paper":
            return mask if region is None else mask & region
        pixels = mask.size
        hole = round(settings.max_hole_share * pixels)
        return cleanup.clean(mask, min_area_px=round(settings.min_area_share * pixels), max_hole_px=hole, region=region)

    def _paper(self, frame: np.ndarray) -> np.ndarray:
        mask = np.empty(frame.shape[:2], np.bool_)
        settings = self.settings
        log_likelihood, raw = np.float32(settings.log_likelihood), np.float32(settings.raw_difference)
        kernels.paper_mask(frame, self.mean, self.unit_mean, self._half_precision, self._log_peak, log_likelihood, raw, mask)
        return mask


def _median(stack: np.ndarray) -> np.ndarray:
    """Median over the first axis, (T, H, W, 3) uint8 -> (H, W, 3), in strips of rows to keep memory small."""
    return np.concatenate([np.median(stack[:, row : row + 16], axis=0).astype(np.uint8) for row in range(0, stack.shape[1], 16)])


def _check(frame: np.ndarray, shape: tuple[int, ...] | None) -> None:
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
        raise TypeError(f"frame must be (H, W, 3) uint8, got {frame.shape} {frame.dtype}")
    if shape is not None and frame.shape != shape:
        raise ValueError(f"frame must be {shape} like the background, got {frame.shape}")
