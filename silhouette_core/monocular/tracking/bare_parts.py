"""Which parts of a person have the colours of the head, and what a pose costs that shows them
elsewhere.

A bare forearm before the trunk shows the colours of the head there, one behind the trunk does not:
that tells the near arm from the far one in poses that the proposal has hardly learned. Whether
sleeves and trousers are short is learned from the frames. Beyond paper A, which names the inside of
the outline as further work (section 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.monocular.tuning import BARE

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
            camera: pinhole camera without distortion.
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
