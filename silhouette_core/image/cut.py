"""A silhouette by a minimum cut: beside the background, colours and edges decide.

Clothes may resemble what is behind them, and an estimated background has places where nobody knows
it. Each pixel's odds compare the person's colours with the background's, and neighbours of like
colour belong together. The colours are learned from the recording: a sample of its frames is cut,
the colours learned from what was found, and so on.

After GrabCut (Rother, Kolmogorov and Blake, 2004) and Background Cut (Sun et al., 2006).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from calib.checks import BoolArray, ByteArray, Float32Array
from silhouette_core.image.cast_shadow import rising_shades
from silhouette_core.image.difference import Background, FrameView, noise_scale
from silhouette_core.image.grey import texture_evidence
from silhouette_core.image.kernels import cut as kernels
from silhouette_core.image.kernels import foreground
from silhouette_core.image.person_colours import SHIFT, PersonColours, even_colours, without_tint
from silhouette_core.tuning import COLOURS, CUT

_ROUNDS = 6  # sweeps of the messages from each side
_LEARNED = 3  # times that the colours are learned and the samples cut


@dataclass(frozen=True, eq=False)
class SceneColours:
    """Colours by which frames are cut, and the background at the size at which they are."""

    person: Float32Array  #: (n, n, n) float32, logarithm of the density of the person's colours.
    worn: Float32Array
    """(n, n, n) float32, what speaks against the person counts by this factor: that an estimated
    background has the colour of clothes is one coincidence, wherever it is seen."""
    others: Float32Array  #: (n, n, n) float32, density of the background's, wherever they are seen.
    background: Background  #: reduced; its frames have its exposure.
    by_texture: float | None = None
    """Share of the person's pixels, in the frames from which they are learned, that texture alone
    tells from a shadow; None of cameras that film in colour, and where no frame was looked at."""

    @classmethod
    def of(cls, background: Background) -> "SceneColours":
        """Colours before a background while nothing is known of the person's."""
        reduced = _reduced(background, cut_size(background.known.shape[::-1]))
        even = even_colours(background)
        scene = PersonColours(even)
        scene.add(np.rint(reduced.mean.clip(0, 255)).astype(np.uint8), reduced.known)
        density = scene.density()
        others = even if density is None else np.exp(density)
        return cls(np.log(_any_colour(even, others)), np.ones_like(others), others, reduced)

    def wearing(self, density: Float32Array) -> "SceneColours":
        """The same with colours of a person, as of `PersonColours`, not all of which were seen."""
        unseen = _any_colour(even_colours(self.background), self.others)
        person = CUT.seen * np.exp(density) + (1 - CUT.seen) * unseen
        return replace(self, person=np.log(person))

    def near(self, background: Background, window: tuple[slice, slice]) -> "SceneColours":
        """The same in a window of rows and columns of the background, which has its full size."""
        scale = len(self.background.mean) / len(background.mean)
        size = (max(round(scale * side), 1) for side in background.known[window].shape[::-1])
        return replace(self, background=_reduced(background, tuple(size), window))

    def learned(
        self, frames: ByteArray, filmed: bool, evidence: Sequence[Float32Array] | None = None
    ) -> "SceneColours":
        """Colours from frames (T, H, W, 3) uint8 with the exposure of their background, which was
        filmed or is estimated, and what else speaks for a person in each, as of `cut`.
        """
        reduced, others = self.background, self.others
        small = [_resized(frame, reduced) for frame in frames]
        even = even_colours(reduced)
        colours = replace(self, person=np.log(even), others=even)
        # Somebody is mostly before what was never seen: so begins what is known of clothes.
        guess = replace(colours, others=even * COLOURS.otherwise)
        occupied = [~reduced.known & (guess._odds(frame) > -CUT.beside) for frame in small]
        if evidence is not None:
            occupied = [odds > 0 for odds in evidence]
        for turn in range(_LEARNED):
            person = PersonColours(even)
            known_odds = evidence or [None] * len(small)
            for frame, odds, before in zip(small, known_odds, occupied, strict=True):
                person.add(frame, colours.cut(frame, odds) | (before & (turn == 0)))
            density = person.density()
            if density is None:
                break
            typical = density > np.maximum(np.log(CUT.typical * others), person.least(density))
            worn = np.where(typical & (not filmed), CUT.worn, 1).astype(np.float32)
            colours = replace(self, person=density, worn=worn)
        if not reduced.grey:
            return colours
        return replace(colours, by_texture=colours._share_by_texture(small))

    def _share_by_texture(self, frames: Sequence[ByteArray]) -> float:
        """`by_texture` of frames (h, w, 3) uint8 of the reduced background's size."""
        people = np.stack([self.cut(frame) for frame in frames])
        views = (FrameView.of(frame, self.background) for frame in frames)
        textured = np.stack([texture_evidence(view) != 0 for view in views])
        return float(np.count_nonzero(people & textured) / max(np.count_nonzero(people), 1))

    def noise(self, frame: ByteArray) -> float:
        """Ratio of the noise of a frame (H, W, 3) uint8 of the full size to the model's."""
        return noise_scale(FrameView.of(_resized(frame, self.background), self.background))

    def cut(
        self, frame: ByteArray, evidence: Float32Array | None = None, noise: float | None = None
    ) -> BoolArray:
        """The person (h, w) bool in a frame (h, w, 3) uint8 of the reduced background's size.

        Args:
            evidence: more that speaks for the person, (h, w) nats.
            noise: of `noise`; None: measured on this frame.
        """
        back, odds = self.background, self._odds(frame, evidence, noise)
        links = np.empty((2, *odds.shape), np.float32)
        kernels.contrast(frame, back.mean, back.known, links)
        scale = 2 * max(float(links.mean()), CUT.least_contrast)
        links = (CUT.link * np.exp(-links / scale) + CUT.least_link).astype(np.float32)
        return least_cut(odds, links)

    def odds(self, frame: ByteArray, evidence: Float32Array | None = None) -> Float32Array:
        """Odds of the person (H, W), nats, by which a frame (H, W, 3) uint8 of the full size is cut
        with more that speaks for the person, as of `cut`.
        """
        odds = self._odds(_resized(frame, self.background), evidence)
        size = frame.shape[1::-1]
        return np.asarray(cv2.resize(odds, size, interpolation=cv2.INTER_NEAREST), np.float32)

    def _odds(
        self, frame: ByteArray, evidence: Float32Array | None = None, noise: float | None = None
    ) -> Float32Array:
        """Odds of the person (h, w), nats, in each pixel of a reduced frame, as of `cut`."""
        back = self.background
        view = FrameView.of(frame, back)
        odds = np.empty(frame.shape[:2], np.float32)
        flicker = np.float32(0 if back.grey else CUT.flicker)  # nothing else tells a grey face
        scale, shades = np.float32(noise or noise_scale(view)), rising_shades(back.shadow)
        uneven, spread = without_tint(view)
        densities = self.person, self.others, self.worn
        foreground.log_odds(
            *view.arrays, scale, flicker, shades, uneven, spread, densities, SHIFT, back.known, odds
        )
        return odds if evidence is None else odds + evidence

    def silhouette(
        self, frame: ByteArray, evidence: Float32Array | None = None, noise: float | None = None
    ) -> BoolArray:
        """The person (H, W) bool in a frame (H, W, 3) uint8 of the full size, as of `cut`."""
        small = _resized(frame, self.background)
        mask = self.cut(small, evidence, noise).astype(np.float32)
        size = frame.shape[1::-1]
        return np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_LINEAR)) > 0.5


def least_cut(odds: Float32Array, links: Float32Array) -> BoolArray:
    """The person (h, w) bool, nearly of least cost, by odds (h, w) float32 of each pixel, nats, and
    the cost of neighbours that differ, links (2, h, w) float32, to the right and downward.
    """
    # Columns lie in a row's place where messages go sideways, so that loops run along the memory.
    turned, across = cv2.transpose(odds), cv2.transpose(links[0])
    sideways, upright = np.zeros((2, *turned.shape), np.float32), np.zeros_like(links)
    totals, turned_totals = np.empty_like(odds), np.empty_like(turned)
    for _ in range(_ROUNDS):
        np.add(*upright, out=totals)
        cv2.transpose(totals, turned_totals)
        turned_totals += turned
        kernels.pass_on(turned_totals, across, sideways)
        np.add(*sideways, out=turned_totals)
        cv2.transpose(turned_totals, totals)
        totals += odds
        kernels.pass_on(totals, links[1], upright)
    return totals + upright[0] + upright[1] > 0


def cut_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height, px, at which frames of a size are cut."""
    factor = min(1.0, CUT.side_px / min(size))
    return max(round(size[0] * factor), 1), max(round(size[1] * factor), 1)


def _reduced(
    background: Background,
    size: tuple[int, ...],
    window: tuple[slice, slice] = (slice(None), slice(None)),
) -> Background:
    """Background in a window, in the size (w, h) in which it is cut."""
    known = background.known[window].astype(np.float32)
    mean, noise, known = (
        cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        for image in (background.mean[window], 1 / background.scales[1][window], known)
    )
    reduced = Background.from_noise(np.asarray(mean, np.float32), np.asarray(noise, np.float32))
    return replace(
        reduced,
        shadow=background.shadow,
        known=np.asarray(known) > 0.8,
        grey=background.grey,
        several=background.several,
    )


def _any_colour(even: Float32Array, scene: Float32Array) -> Float32Array:
    """Density of the colours of somebody of whom nothing is known: any, the scene's, too."""
    return np.asarray((1 - CUT.alike) * even + CUT.alike * scene, np.float32)


def _resized(frame: ByteArray, reduced: Background) -> ByteArray:
    size = reduced.mean.shape[1::-1]
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), np.uint8)
