"""Background model of one fixed camera, and silhouettes by background subtraction."""

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.image.cast_shadow import count_shadows, darkest_shadow
from silhouette_core.image.cut import SceneColours
from silhouette_core.image.difference import (
    Background,
    Exposure,
    measure_exposure,
    measure_gain,
)
from silhouette_core.image.empty_scene import EmptyScene, Kind
from silhouette_core.image.exposure import aligned
from silhouette_core.image.foreground import (
    SilhouetteStages,
    SoftSilhouette,
    refined_mask,
    refined_soft_silhouette,
    refined_stages,
)
from silhouette_core.image.kernels import background as kernels
from silhouette_core.image.person_colours import ColourDensity, ColouredSilhouette, find_colours
from silhouette_core.tuning import BACKGROUND

Method = Literal["refined", "paper"]
"""Okada and Stenger's section 5.1 as written, without any clean-up, or `image.foreground`."""
Odds = Sequence[NDArray[np.float32]]
_SHADOW_STEP = 5  # every so many-th sample tells how dark shadows are
_PRIOR_FRAMES = 10  # weight of the assumed noise, in frames, against the measured one


@dataclass(frozen=True, eq=False)
class _ColourStatistics:
    """Statistics of each pixel's colour and of its colour divided by its length.

    Attributes:
        mean: (H, W, 3) float64, of the colour, BGR of 255.
        variance: (H, W, 3) float64, of the colour.
        unit_mean: (H, W, 3) float64, of the normalised colour.
        unit_variance: (H, W, 3) float64, of the normalised colour.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    unit_mean: NDArray[np.float64]
    unit_variance: NDArray[np.float64]


class BackgroundModel:
    """Background of one camera. Construct it with `from_frames` or `from_occupied`.

    Source: Okada and Stenger, section 5.1. `from_occupied`, the lower bound of the noise and the
    refined method are ours.
    """

    def __init__(self, statistics: _ColourStatistics, method: Method):
        """Prepares the model; use the constructors `from_...`."""
        self.method: Method = method
        self.mean: NDArray[np.float32] = np.ascontiguousarray(statistics.mean, np.float32)
        noise = np.maximum(np.sqrt(statistics.variance.mean(axis=2)), BACKGROUND.noise)
        self._background = Background.from_noise(self.mean, noise)
        # Noise of the channels turns a colour of length L by noise / L: the direction of dark
        # pixels is uncertain.
        length = np.maximum(np.linalg.norm(statistics.mean, axis=2, keepdims=True), 1.0)
        variance = np.maximum(statistics.unit_variance, (BACKGROUND.noise / length) ** 2)
        self._unit_mean = np.ascontiguousarray(statistics.unit_mean, np.float32)
        self._half_precision = np.ascontiguousarray(0.5 / variance, np.float32)
        self._log_peak = np.ascontiguousarray(
            -0.5 * np.log(2 * np.pi * variance).sum(axis=2), np.float32
        )
        self._colours: SceneColours | None = None
        self.uniform = False  # whether it is a backdrop, found in occupied frames

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.mean.shape[1], self.mean.shape[0]

    @property
    def has_colours(self) -> bool:
        """Whether the colours of person and scene decide: frames are then looked at as a whole."""
        return self._colours is not None

    @classmethod
    def from_frames(
        cls, frames: Iterable[np.ndarray], method: Method = "refined"
    ) -> "BackgroundModel":
        """Background from frames of the empty scene, read one after the other.

        Args:
            frames: each (H, W, 3) uint8, BGR; at least one.
            method: see `Method`.

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
        measured, assumed = np.maximum(square - mean**2, 0), BACKGROUND.noise**2
        variance = (count * measured + _PRIOR_FRAMES * assumed) / (count + _PRIOR_FRAMES)
        unit_variance = np.maximum(unit_square - unit_mean**2, 0)
        return cls(_ColourStatistics(mean, variance, unit_mean, unit_variance), method)

    @classmethod
    def from_occupied(
        cls,
        frames: Iterable[np.ndarray],
        method: Method = "refined",
        evidence: Odds | None = None,
        kind: Kind = "auto",
    ) -> "BackgroundModel":
        """Background from frames in which a person is always somewhere; see `EmptyScene`.

        Args:
            frames: each (H, W, 3) uint8, BGR; all are held in memory, so give a sample, for example
                40 over the recording.
            method: see `Method`.
            evidence: as of `with_colours`.
            kind: what it is taken from.

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
        people = None if evidence is None else np.stack(evidence) > 0
        scene = EmptyScene.from_frames(np.stack(stack), people, kind)
        mean, variance = scene.mean.astype(np.float64), scene.variance.astype(np.float64)
        length = np.maximum(np.linalg.norm(mean, axis=2, keepdims=True), 1.0)
        statistics = _ColourStatistics(mean, variance, mean / length, variance / length**2)
        model = cls(statistics, method)
        model._background = replace(model._background, known=~scene.unseen)
        asked = scene.frames[::_SHADOW_STEP]
        counts = np.sum([count_shadows(one, model._background) for one in asked], axis=0)
        darkest = darkest_shadow(counts)
        model = model if darkest is None else model.with_shadow(darkest)
        model._colours = SceneColours.learned(scene.frames, model._background, False, evidence)
        model.uniform = scene.uniform
        return model

    def with_colours(
        self,
        frames: Sequence[np.ndarray] | np.ndarray,
        evidence: Odds | None = None,
    ) -> "BackgroundModel":
        """The same background, which was filmed, with the colours of the person in some frames.

        Args:
            frames: each (H, W, 3) uint8, BGR, of the model's size.
            evidence: what else speaks for a person in each frame, nats, of the size `cut_size`.
        """
        model = copy(self)
        same = np.stack([aligned(np.ascontiguousarray(one), self.mean) for one in frames])
        model._colours = SceneColours.learned(same, self._background, True, evidence)
        return model

    def silhouette(
        self,
        frame: np.ndarray,
        region: np.ndarray | None = None,
        exposure: Exposure | None = None,
        evidence: NDArray[np.float32] | None = None,
    ) -> np.ndarray:
        r"""Silhouette of the foreground in a frame.

        With the method "paper", a pixel of colour :math:`c` (3,) is foreground where the density of
        its normalised colour is low or its un-normalised colour differs clearly:

        .. math::

            \prod_{k=1}^{3} \frac{1}{\sqrt{2 \pi}\, \sigma_k}
            \exp\left(-\frac{(u_k - \mu_k)^2}{2 \sigma_k^2}\right) < \theta
            \quad \text{or} \quad \lVert c - \bar c \rVert > \tau,
            \qquad u = \frac{c}{\lVert c \rVert}

        with mean :math:`\mu` and diagonal variance :math:`\sigma^2` of :math:`u` at that pixel (no
        unit), mean colour :math:`\bar c` (of 255), :math:`\log \theta` = `log_likelihood` and
        :math:`\tau` = `raw_difference` of `tuning.BACKGROUND`.

        Args:
            frame: (H, W, 3) uint8, BGR, of the model's size.
            region: region of interest, (H, W) bool; None means the whole image.
            exposure: of the frame, for the refined method; None: measured here.
            evidence: what else speaks for a person, nats, of the size `cut_size`, where colours
                decide.

        Returns:
            Silhouette, (H, W) bool.

        Raises:
            ValueError: the frame has another size than the background.
            TypeError: the frame is not uint8.
        """
        frame = self._aligned(frame)
        if self.method == "refined":
            cut = self._cut(frame, evidence)
            return refined_mask(frame, self._background, region, exposure, cut=cut)
        mask = np.empty(frame.shape[:2], np.bool_)
        limits = np.float32(BACKGROUND.log_likelihood), np.float32(BACKGROUND.raw_difference)
        kernels.paper_mask(
            frame, self.mean, self._unit_mean, self._half_precision, self._log_peak, *limits, mask
        )
        return mask if region is None else mask & region

    def soft_silhouette(
        self,
        frame: np.ndarray,
        region: np.ndarray | None = None,
        evidence: NDArray[np.float32] | None = None,
    ) -> SoftSilhouette:
        """Silhouette of a frame, and where else it differs from the background; the paper's method
        gives the silhouette only.

        Args:
            frame: (H, W, 3) uint8, BGR.
            region: region of interest, (H, W) bool; None means the whole image.
            evidence: as of `silhouette`.

        Raises:
            ValueError: the frame has another size than the model.
            TypeError: the frame is not uint8.
        """
        if self.method == "paper":
            return SoftSilhouette.of(self.silhouette(frame, region))
        frame = self._aligned(frame)
        return refined_soft_silhouette(frame, self._background, region, self._cut(frame, evidence))

    def stages(
        self,
        frame: np.ndarray,
        region: np.ndarray | None = None,
        evidence: NDArray[np.float32] | None = None,
    ) -> SilhouetteStages:
        """How a frame's silhouette comes about; of the paper's method only what it makes.

        Args:
            frame: (H, W, 3) uint8, BGR.
            region: region of interest, (H, W) bool; None means the whole image.
            evidence: as of `silhouette`.

        Raises:
            ValueError: the frame has another size than the model.
            TypeError: the frame is not uint8.
        """
        aligned_frame, known = self._aligned(frame), self._background.known
        if self.method == "paper":
            first, found = self.silhouette(frame), self.silhouette(frame, region)
            return SilhouetteStages(aligned_frame, self.mean, known, first, found)
        cut = self._cut(aligned_frame, evidence)
        stages = refined_stages(aligned_frame, self._background, region, cut)
        if self._colours is None:
            return stages
        return replace(stages, odds=self._colours.odds(aligned_frame, evidence))

    def coloured_silhouette(
        self,
        frame: np.ndarray,
        density: ColourDensity,
        region: np.ndarray | None = None,
        least_odds: float = 0.0,
    ) -> ColouredSilhouette:
        """Where a frame has a person's colours, see `find_colours`.

        Args:
            frame: (H, W, 3) uint8, BGR.
            density: of the person's colours.
            region: region of interest, (H, W) bool; None means the whole image.
            least_odds: nats by which the person has to explain a place better.

        Raises:
            ValueError: the frame has another size than the model.
            TypeError: the frame is not uint8.
        """
        frame = self._aligned(frame)
        return find_colours(frame, self._background, density, region, least_odds)

    def silhouette_near(
        self,
        part: np.ndarray,
        window: tuple[slice, slice],
        exposure: Exposure,
        region: np.ndarray | None = None,
    ) -> np.ndarray:
        """Silhouette by the refined method of a frame of which only a part is looked at.

        Args:
            part: (h, w, 3) uint8, BGR: the frame in the window.
            window: rows and columns, within the model's size.
            exposure: of the frame, or of one shortly before it.
            region: region of interest, (H, W) bool; None means the whole image.

        Returns:
            Silhouette, (H, W) bool: nothing outside the window.

        Raises:
            ValueError: the part has another size than the window.
            TypeError: the part is not uint8.
        """
        check_array("part", part, self.mean[window].shape, np.uint8)
        part = np.ascontiguousarray(part)
        return refined_mask(part, self._background, region, exposure, window)

    def shadow_counts(self, frame: np.ndarray) -> NDArray[np.int64]:
        """See `silhouette_core.image.cast_shadow.count_shadows`; the frame is (H, W, 3) uint8."""
        return count_shadows(self._aligned(frame), self._background)

    def with_shadow(self, darkest: float) -> "BackgroundModel":
        """The same background with another darkest cast shadow, see `difference.Background`."""
        model = copy(self)
        model._background = replace(self._background, shadow=darkest)
        return model

    def exposure(self, frame: np.ndarray) -> Exposure:
        """Exposure of a frame (H, W, 3) uint8, BGR, of the model's size."""
        return measure_exposure(self._aligned(frame), self._background)

    def gain(self, frame: np.ndarray) -> np.ndarray:
        """Each channel's gain, (3,) float32, of a frame uint8, BGR, of this size or larger."""
        return measure_gain(frame, self._background)

    def _aligned(self, frame: np.ndarray) -> NDArray[np.uint8]:
        """A whole frame, checked; where colours decide, with the exposure of the background."""
        check_array("frame", frame, self.mean.shape, np.uint8)
        frame = np.ascontiguousarray(frame)
        return aligned(frame, self.mean) if self.has_colours else frame

    def _cut(
        self, frame: NDArray[np.uint8], evidence: NDArray[np.float32] | None
    ) -> NDArray[np.bool_] | None:
        return None if self._colours is None else self._colours.silhouette(frame, evidence)
