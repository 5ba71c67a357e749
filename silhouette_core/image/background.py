"""Background model of one fixed camera, and silhouettes by background subtraction."""

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import ByteArray, Float32Array, FloatArray, IntArray, check_array
from silhouette_core.image.cast_shadow import count_shadows, darkest_shadow
from silhouette_core.image.cut import SceneColours
from silhouette_core.image.difference import Background
from silhouette_core.image.empty_scene import EmptyScene, Kind
from silhouette_core.image.exposure import Aligner, Exposure
from silhouette_core.image.foreground import (
    SilhouetteStages,
    SoftSilhouette,
    refined_soft_silhouette,
    refined_stages,
    segmented,
)
from silhouette_core.image.grey import is_grey
from silhouette_core.image.kernels import backgrounds as kernels
from silhouette_core.image.person_colours import PersonColours, even_colours
from silhouette_core.tuning import BACKGROUND

Method = Literal["refined", "paper"]
"""Okada and Stenger's section 5.1 as written, without any clean-up, or `image.foreground`."""
Odds = Sequence[Float32Array]
Region = np.ndarray | None  #: See `BackgroundModel.silhouette`.
Evidence = Float32Array | None  #: See there.
_SHADOW_STEP = 5  # every so many-th sample tells how dark shadows are
_PRIOR_FRAMES = 10  # weight of the assumed noise, in frames, against the measured one


_Directions = tuple[Float32Array, Float32Array, Float32Array]
"""Each pixel's colour divided by its length, for the paper's method: mean (H, W, 3), half of one
over the variance (H, W, 3), and logarithm of the density at the mean (H, W)."""


def _directions(colour: FloatArray, mean: FloatArray, variance: FloatArray) -> _Directions:
    """Directions of the mean colour, BGR of 255; their mean and variance, all (H, W, 3)."""
    # Noise of the channels turns a colour of length L by noise / L: the direction of dark pixels is
    # uncertain.
    variance = np.maximum(variance, (BACKGROUND.noise / _length(colour)) ** 2)
    peak = -0.5 * np.log(2 * np.pi * variance).sum(axis=2)
    return mean.astype(np.float32), (0.5 / variance).astype(np.float32), peak.astype(np.float32)


def _length(colour: NDArray) -> FloatArray:
    """Length (H, W, 1) of colours (H, W, 3), at least 1."""
    return np.maximum(np.linalg.norm(colour, axis=2, keepdims=True), 1.0)


class BackgroundModel:
    """Background of one camera. Construct it with `from_frames` or `from_occupied`.

    Source: Okada and Stenger, section 5.1. `from_occupied`, the lower bound of the noise and the
    refined method are ours.
    """

    def __init__(self, mean: FloatArray, variance: FloatArray, directions: _Directions | None):
        self.method: Method = "refined" if directions is None else "paper"
        self.mean: Float32Array = np.ascontiguousarray(mean, np.float32)
        noise = np.maximum(np.sqrt(variance.mean(axis=2)), BACKGROUND.noise)
        self._background = Background.from_noise(self.mean, noise)
        self._directions, self._aligner = directions, Aligner(self.mean)
        self._colours = None if self.method == "paper" else SceneColours.of(self._background)
        self._person = PersonColours()  # as frames come
        self.uniform = False  # whether it is a backdrop, found in occupied frames

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.mean.shape[1], self.mean.shape[0]

    @property
    def grey(self) -> bool:
        """Whether the camera is known to film without colour."""
        return self._background.grey

    @property
    def several(self) -> bool:
        """Whether what is darker counts as the person, see `difference.Background`."""
        return self._background.several

    @property
    def by_texture(self) -> float | None:
        """See `SceneColours.by_texture`; 0 where what is darker counts as the person; None where no
        frame was looked at beforehand.
        """
        if self.several:
            return 0.0
        share = None if self._colours is None else self._colours.by_texture
        return None if share is None else round(share, 4)

    @classmethod
    def from_frames(
        cls, frames: Iterable[np.ndarray], method: Method = "refined"
    ) -> "BackgroundModel":
        """Background from frames of the empty scene, read one after the other. Raises ValueError
        where there is no frame, or one is not (H, W, 3) or of another size, TypeError where one is
        not uint8.

        Args:
            frames: each (H, W, 3) uint8, BGR; at least one.
            method: see `Method`.
        """
        count = 0
        sums: list[np.ndarray] = []  # of colours and of their squares, then of directions
        for frame in frames:
            check_array("frame", frame, sums[0].shape if sums else ("H", "W", 3), np.uint8)
            seen = [frame] if method == "refined" else [frame, frame / _length(frame)]
            sums = sums or [np.zeros(frame.shape) for _ in range(2 * len(seen))]
            for k, image in enumerate(seen):
                cv2.accumulate(image, sums[2 * k])
                cv2.accumulateSquare(image, sums[2 * k + 1])
            count += 1
        if not count:
            raise ValueError("frames must hold at least one picture of the empty scene, got none")
        mean, *unit_mean = (total / count for total in sums[::2])
        square, *unit_square = (total / count for total in sums[1::2])
        measured, assumed = np.maximum(square - mean**2, 0), BACKGROUND.noise**2
        variance = (count * measured + _PRIOR_FRAMES * assumed) / (count + _PRIOR_FRAMES)
        if not unit_mean:
            return cls(mean, variance, None)
        unit_variance = np.maximum(unit_square[0] - unit_mean[0] ** 2, 0)
        return cls(mean, variance, _directions(mean, unit_mean[0], unit_variance))

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
            evidence: as of `with_colours`.
            kind: what it is taken from.

        Method and errors are those of `from_frames`.
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
        length, directions = _length(mean), None
        if method == "paper":
            directions = _directions(mean, mean / length, variance / length**2)
        model = cls(mean, variance, directions)._with(known=~scene.unseen).as_grey(scene.frames)
        asked = scene.frames[::_SHADOW_STEP]
        counts = np.sum([count_shadows(one, model._background) for one in asked], axis=0)
        darkest = darkest_shadow(counts)
        model = model if darkest is None else model.with_shadow(darkest)
        colours = SceneColours.of(model._background)
        model._colours = colours.learned(scene.frames, False, evidence)
        model.uniform = scene.uniform
        return model

    def with_colours(
        self, frames: Sequence[np.ndarray] | np.ndarray, evidence: Odds | None = None
    ) -> "BackgroundModel":
        """The same background, which was filmed, with the colours of the person in some frames.

        Args:
            frames: each (H, W, 3) uint8, BGR, of the model's size.
            evidence: what else speaks for a person in each frame, nats, of the size `cut_size`.
        """
        model = copy(self)
        same = np.stack([self._aligner.aligned(np.ascontiguousarray(one)) for one in frames])
        model._colours = SceneColours.of(self._background).learned(same, True, evidence)
        return model

    def silhouette(
        self, frame: np.ndarray, region: Region = None, evidence: Evidence = None
    ) -> np.ndarray:
        r"""Silhouette of the foreground in a frame.

        With the method "paper", a pixel of colour :math:`c` (3,) is foreground where the density of
        its normalised colour is low or its un-normalised colour differs clearly:

        .. math::

            \prod_{k=1}^{3} \frac{1}{\sqrt{2 \pi}\, \sigma_k}
            \exp\left(-\frac{(u_k - \mu_k)^2}{2 \sigma_k^2}\right) < \theta
            \quad \text{or} \quad \lVert c - \bar c \rVert > \tau,
            \qquad u = \frac{c}{\lVert c \rVert}

        with mean :math:`\mu` and diagonal variance :math:`\sigma^2` of :math:`u` at that pixel
        (no unit), mean colour :math:`\bar c` (of 255), :math:`\log \theta` = `log_likelihood` and
        :math:`\tau` = `raw_difference` of `tuning.BACKGROUND`. Raises ValueError where the frame
        has another size than the background; TypeError where the frame is not uint8.

        Args:
            frame: (H, W, 3) uint8, BGR, of the model's size.
            region: region of interest, (H, W) bool; None means the whole image.
            evidence: what else speaks for a person, nats, of the size `cut_size`, refined method.

        Returns:
            Silhouette, (H, W) bool.
        """
        frame = self._aligned(frame)
        if self._colours is not None:
            cut = self._colours.silhouette(frame, evidence)
            return segmented(frame, self._background, cut, region)
        assert self._directions is not None, "only the paper's method has no colours"
        mask = np.empty(frame.shape[:2], np.bool_)
        density = np.float32(BACKGROUND.log_likelihood)
        difference = np.float32(BACKGROUND.raw_difference)
        kernels.paper_mask(frame, self.mean, *self._directions, density, difference, mask)
        return mask if region is None else mask & region

    def look(
        self, frame: np.ndarray, region: Region = None, evidence: Evidence = None
    ) -> tuple[np.ndarray, Exposure]:
        """Silhouette of a frame of those that come, as of `silhouette` by the refined method, from
        which the person's colours are learned; and its exposure.
        """
        if self._colours is None:
            raise ValueError("the paper's method learns nothing of the person")
        check_array("frame", frame, self.mean.shape, np.uint8)
        coefficients = self._aligner.fitted(frame)
        frame = self._aligner.applied(np.ascontiguousarray(frame), coefficients)
        exposure = Exposure(coefficients, self._colours.noise(frame))
        cut = self._colours.silhouette(frame, evidence, exposure.noise)
        mask = segmented(frame, self._background, cut, region)
        self._person.add(frame, mask)
        density = self._person.density()
        if density is not None:
            self._colours = self._colours.wearing(density)
        return mask, exposure

    def soft_silhouette(
        self, frame: np.ndarray, region: Region = None, evidence: Evidence = None
    ) -> SoftSilhouette:
        """Silhouette of a frame, and where else it differs from the background; the paper's method
        gives the silhouette only. Arguments and errors are those of `silhouette`.
        """
        if self._colours is None:
            return SoftSilhouette.of(self.silhouette(frame, region))
        frame = self._aligned(frame)
        cut = self._colours.silhouette(frame, evidence)
        return refined_soft_silhouette(frame, self._background, cut, region)

    def stages(
        self, frame: np.ndarray, region: Region = None, evidence: Evidence = None
    ) -> SilhouetteStages:
        """How a frame's silhouette comes about; of the paper's method only what it makes. Arguments
        and errors are those of `silhouette`.
        """
        aligned_frame, known = self._aligned(frame), self._background.known
        if self._colours is None:
            first, silhouette = self.silhouette(frame), self.silhouette(frame, region)
            return SilhouetteStages(aligned_frame, self.mean, known, first, silhouette)
        cut = self._colours.silhouette(aligned_frame, evidence)
        stages = refined_stages(aligned_frame, self._background, cut, region)
        return replace(stages, odds=self._colours.odds(aligned_frame, evidence))

    def silhouette_near(
        self,
        frame: np.ndarray,
        part: np.ndarray,
        window: tuple[slice, slice],
        exposure: Exposure,
        region: Region = None,
    ) -> np.ndarray:
        """Silhouette by the refined method of a frame of which only a part is looked at. Raises
        ValueError where the part has another size than the window; TypeError where the part is not
        uint8.

        Args:
            frame: (H', W', 3) uint8, BGR, the whole frame as filmed, which tells the exposure.
            part: (h, w, 3) uint8, BGR: the frame in the window.
            window: rows and columns, within the model's size.
            exposure: of a frame shortly before it, from `look`.
            region: as of `silhouette`.

        Returns:
            Silhouette, (H, W) bool: nothing outside the window.
        """
        check_array("part", part, self.mean[window].shape, np.uint8)
        if self._colours is None:
            raise ValueError("the paper's method looks at whole frames")
        coefficients = self._aligner.shifted(frame, exposure.coefficients)
        part = self._aligner.applied(np.ascontiguousarray(part), coefficients, window)
        colours = self._colours.near(self._background, window)
        cut = colours.silhouette(part, noise=exposure.noise)
        return segmented(part, self._background, cut, region, window)

    def shadow_counts(self, frame: np.ndarray) -> IntArray:
        """See `silhouette_core.image.cast_shadow.count_shadows`; the frame is (H, W, 3) uint8."""
        # Light that changes smoothly over the picture would explain large shadows, too.
        even = self._aligner.shifted(frame, np.zeros((3, 6)))
        return count_shadows(self._aligner.applied(frame, even), self._background)

    def as_grey(
        self, frames: Sequence[np.ndarray] | np.ndarray, several: bool = False
    ) -> "BackgroundModel":
        """The same background, known to be of a camera without colour where no frame has any.

        Args:
            frames: each (H, W, 3) uint8, BGR.
            several: see `difference.Background`.
        """
        return self._with(grey=all(map(is_grey, [self.mean, *frames])), several=several)

    def with_shadow(self, darkest: float) -> "BackgroundModel":
        """The same background with another darkest cast shadow, see `difference.Background`."""
        return self._with(shadow=darkest)

    def _with(self, **changed: Any) -> "BackgroundModel":
        """The same model with some attributes of its background changed."""
        model = copy(self)
        model._background = replace(self._background, **changed)
        if self._colours is not None:
            model._colours = SceneColours.of(model._background)
            model._person = PersonColours(even_colours(model._background))
        return model

    def _aligned(self, frame: np.ndarray) -> ByteArray:
        """A whole frame, checked; for the refined method with the exposure of the background."""
        check_array("frame", frame, self.mean.shape, np.uint8)
        frame = np.ascontiguousarray(frame)
        return frame if self.method == "paper" else self._aligner.aligned(frame)
