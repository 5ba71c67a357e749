"""What lies inside the outline: where the person has the colours of the head, and shading.

The proposal finds the head without colours, pictures then tell which colours it has, and what else
has them tells where bare arms and hands lie before the body. How bright each place is, relative to
others of its colour, tells which way it faces. Of the hypotheses, those that show parts bare or
clothed where they are not cost more: that tells the near arm from the far one. Whether sleeves and
trousers are short is learned from the frames. Beyond paper A, which names the inside of the
outline as further work (section 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.image.head_colours import ColourCrop, HeadColours
from silhouette_core.image.shading import ColourBrightness, relative_shading
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.proposal.silhouette_features import (
    FULL,
    GRID,
    InsideGrids,
    counted,
    shading_grid,
)
from silhouette_core.monocular.silhouette_weights import SignedWeights
from silhouette_core.monocular.tuning import BARE
from silhouette_core.monocular.window import Window

_NECK, _TOP = LANDMARK_NAMES.index("neck"), LANDMARK_NAMES.index("head_top")
_LIMBS = {  # parts: the joints between which they lie, and from where to where on that way
    ("upper_arm",): ("shoulder", "elbow", BARE.along),
    ("forearm",): ("elbow", "wrist", BARE.along),
    ("hand", "thumb", "fingers"): ("elbow", "wrist", BARE.hand_along),
    ("thigh",): ("hip", "knee", BARE.along),
    ("shin",): ("knee", "ankle", BARE.along),
}
_JOINTS = np.array(
    [
        [
            [LANDMARK_NAMES.index(f"{side}_{joint}") for joint in joints]
            for side in ("left", "right")
        ]
        for *joints, _ in _LIMBS.values()
    ]
)
_ALONG = np.array([np.linspace(*along, 7) for *_, along in _LIMBS.values()])
_BINS = 20
_LEAST_PLACES, _LEAST_FRAMES = 3, 5  # of a limb that a frame must show, and frames that must


class ColourEvidence:
    """Colours of the head, and where they are in a window.

    Args:
        camera: pinhole camera without distortion.
    """

    def __init__(self, camera: Camera):
        self.camera = camera
        self._colours = HeadColours()
        self._likelihood: NDArray[np.float32] | None = None
        self._brightness = ColourBrightness()
        self._mean = self._brightness.mean()
        self._bare = BareParts()

    def learn(
        self, people: Sequence[Person], joints_m: Sequence[NDArray[np.float64]], memory: float
    ) -> bool:
        """Learns the colours from frames; returns whether they are known now.

        Args:
            people: n silhouettes with colours, or without, which are passed over.
            joints_m: n poses' joints (15, 3) in the world.
            memory: weight of all earlier frames.
        """
        self._colours.fade(memory)
        self._brightness.fade(memory)
        for person, joints in zip(people, joints_m, strict=True):
            if person.colours is not None:
                head = self._head(joints, person.colours)
                crop, inside = person.colours, person.colours.part(person.mask)
                self._colours.add(crop.bins, head, inside)
                self._brightness.add(crop.chromaticity[inside], crop.grey[inside])
        self._likelihood = self._colours.likelihood()
        self._mean = self._brightness.mean()
        if self._likelihood is None:
            return False
        self._bare.fade(memory)
        for person, joints in zip(people, joints_m, strict=True):
            if person.colours is not None:
                crop = person.colours
                seen = self._likelihood[crop.bins], crop.part(person.mask), crop.corner
                self._bare.add(*seen, self.camera, joints)
        return True

    def inside(self, window: Window, person: Person) -> InsideGrids | None:
        """Grids (60, 80) of what lies inside the silhouette in a window.

        Returns:
            The grids, or None if the colours are not known.
        """
        if self._likelihood is None or person.colours is None:
            return None
        crop = person.colours
        mask = crop.part(person.mask)
        view = _half_size(window)
        skin = self._warped(self._likelihood[crop.bins] * mask, crop.corner, *view)
        relative = relative_shading(crop.chromaticity, crop.grey, self._mean, mask)
        return InsideGrids(
            np.clip(np.rint(counted(skin)), 0, FULL).astype(np.uint8),
            shading_grid(counted(self._warped(relative, crop.corner, *view))),
        )

    def skin(self, weights: SignedWeights, person: Person) -> SkinEvidence | None:
        """Where the person has the colours of the head, in the window of a frame's pixel weights;
        None if they are not known.
        """
        if self._likelihood is None or person.colours is None:
            return None
        crop = person.colours
        image = self._likelihood[crop.bins] * crop.part(person.mask)
        view = weights.matrix, weights.rotation, weights.signed.shape
        return SkinEvidence(self._warped(image, crop.corner, *view), self._bare.probability())

    def _warped(
        self,
        image: NDArray[np.float32],
        corner: tuple[int, int],
        matrix: NDArray[np.float64],
        rotation: NDArray[np.float64],
        shape: tuple[int, ...],
    ) -> NDArray[np.float32]:
        """Part (h, w) of the picture, whose first pixel is at a corner, as a virtual camera sees
        it: its matrix, rotation from the world, and height and width.
        """
        left, top = corner
        camera_from_virtual = (
            np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1]])
            @ self.camera.matrix
            @ self.camera.rotation
            @ rotation.T
            @ np.linalg.inv(matrix)
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = shape[1], shape[0]
        return np.asarray(
            cv2.warpPerspective(image, camera_from_virtual, size, flags=flags), np.float32
        )

    def _head(self, joints_m: NDArray[np.float64], crop: ColourCrop) -> NDArray[np.bool_]:
        """Pixels (h, w) bool of the head in a crop."""
        neck, top = joints_m[_NECK], joints_m[_TOP]
        ends, depth = self.camera.project(np.stack([neck + BARE.head_from * (top - neck), top]))
        head = np.zeros(crop.bins.shape, np.uint8)
        if not np.isfinite(ends).all():  # behind the camera
            return head.astype(bool)
        length = float(np.linalg.norm(top - neck))
        radius = BARE.head_radius * length * self.camera.matrix[0, 0] / max(float(depth[0]), 0.1)
        one, other = (tuple(int(v) for v in np.round(end - crop.corner)) for end in ends)
        cv2.line(head, one, other, 1, max(1, round(2 * radius)))
        return head.astype(bool)


def _half_size(
    window: Window,
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int]]:
    """Matrix, rotation from the world, height and width of a window's virtual camera at half the
    size.
    """
    rows, columns = 2 * GRID[0], 2 * GRID[1]
    focal = window.focal_px / 2
    matrix = np.array([[focal, 0, (columns - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]])
    return matrix, window.world_from_virtual.T, (rows, columns)


class BareParts:
    """How often the visible parts of limbs have the colours of the head, in the frames so far."""

    def __init__(self) -> None:
        self._counts = np.zeros((len(_LIMBS), _BINS))

    def fade(self, factor: float) -> None:
        """Multiplies the weight of all frames so far by a factor."""
        self._counts *= factor

    def add(
        self,
        likelihood: NDArray[np.float32],
        mask: NDArray[np.bool_],
        corner: tuple[int, int],
        camera: Camera,
        joints_m: NDArray[np.float64],
    ) -> None:
        """Adds a frame.

        Args:
            likelihood: (h, w), how much likelier each pixel's colour is on the head, 0 to 1.
            mask: (h, w) bool, the silhouette.
            corner: column and row of their first pixel in the picture.
            joints_m: (15, 3), joints of a probable pose, in the world.
        """
        pixel, _ = camera.project(joints_m)
        if not np.isfinite(pixel).all():  # behind the camera
            return
        joints = pixel - corner
        upper, lower = joints[_JOINTS[..., 0]], joints[_JOINTS[..., 1]]
        places = upper[:, :, None] + _ALONG[:, None, :, None] * (lower - upper)[:, :, None]
        column, row = np.moveaxis(np.round(places).astype(int), -1, 0)
        height, width = mask.shape
        seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        seen &= mask[row, column]
        number = seen.sum(axis=-1)
        mean = (likelihood[row, column] * seen).sum(axis=-1) / np.maximum(number, 1)
        bins = np.minimum((mean * _BINS).astype(int), _BINS - 1)
        limb, side = np.nonzero(number >= _LEAST_PLACES)
        np.add.at(self._counts, (limb, bins[limb, side]), 1.0)

    def probability(self) -> NDArray[np.float64]:
        """Probability (27,) that a pixel of each part has the colours of the head."""
        total = self._counts.sum(axis=1, keepdims=True)
        rank = (np.cumsum(self._counts, axis=1) >= BARE.share * total).argmax(axis=1)
        limbs = np.where(total[:, 0] < _LEAST_FRAMES, 0.5, (rank + 0.5) / _BINS)
        known = {"head": 1.0, "neck": 0.5}  # a neck may be covered as well as bare
        for names, limb in zip(_LIMBS, limbs, strict=True):
            known |= dict.fromkeys(names, float(limb))
        parts = [name.removeprefix("left_").removeprefix("right_") for name in PART_NAMES]
        chance = np.array([known.get(part, BARE.clothed) for part in parts], float)
        return np.clip(chance, BARE.clothed, 1 - BARE.clothed)


@dataclass(frozen=True, eq=False)
class SkinEvidence:
    """Where a frame shows the colours of the head.

    Attributes:
        likelihood: (h, w) float32, how much likelier each pixel's colour is on the head, 0 to 1.
        bare: (27,) float64, probability that a pixel of each part has these colours.
    """

    likelihood: NDArray[np.float32]
    bare: NDArray[np.float64]

    def cost(self, drawn: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
        r"""Cost (K,), nats, of poses above the best of them.

        .. math:: c = -w \sum_{x} L(x) \log b(x) + (1 - L(x)) \log (1 - b(x))

        over the pixels of the silhouette that the body covers, where b(x) is the probability of the
        part drawn there; it saturates, for what the head's colours tell may be wrong.

        Args:
            drawn: (K, h, w), part images of K poses, 0 where there is none.
            mask: (h, w), the silhouette.
        """
        bare = np.concatenate([[0.5], self.bare])  # elsewhere anything may be seen
        parts, likelihood = drawn[:, mask], self.likelihood[mask]
        cost = -np.log1p(-bare)[parts].sum(axis=1)
        cost += np.log((1 - bare) / bare)[parts] @ likelihood
        above = BARE.pixel * (cost - cost.min())
        return BARE.most * -np.expm1(-above / BARE.most)
