"""Silhouettes whose pieces are joined where clothes look like a shadow on the background.

Trousers of the floor's tint, but darker, are a cast shadow to background subtraction: the feet then
lie apart from the trunk and are taken for noise. Both have colours that are the person's for sure,
and what lies between them differs from the background, if only in brightness. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.estimator import Frame
from silhouette_core.image.person_colours import ColourDensity, PersonColours
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.monocular.person import find_person
from silhouette_core.monocular.tuning import JOINING

_THIN = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, eq=False)
class Sample:
    """A moment of a recording.

    Attributes:
        frames: (H, W, 3) uint8, BGR, by camera name.
        mask: (h, w) bool, the silhouette of the camera in question.
    """

    frames: Mapping[str, Frame]
    mask: NDArray[np.bool_]


class JoinedPerson:
    """Joins the pieces of the silhouettes of one camera."""

    def __init__(self, silhouettes: Silhouettes, name: str, density: ColourDensity):
        self._silhouettes, self._name, self._density = silhouettes, name, density

    @classmethod
    def learned(
        cls, silhouettes: Silhouettes, name: str, samples: Sequence[Sample]
    ) -> JoinedPerson | None:
        """Joins pieces by the colours within the silhouettes of some frames.

        Returns:
            What joins them; None where silhouettes are whole already, or have no colours.
        """
        if not silhouettes.colours_tell:
            return None
        colours = PersonColours()
        for sample in samples:
            person = find_person(sample.mask)
            if person is not None:
                colours.add(silhouettes.scaled(name, sample.frames[name]), person.mask)
        density = colours.density()
        if density is None:
            return None
        joining = cls(silhouettes, name, density)
        gains = [
            joining.of(sample.frames).sum() / sample.mask.sum()
            for sample in samples
            if sample.mask.any()
        ]
        return joining if np.median(gains) >= JOINING.least_gain else None

    def of(self, frames: Mapping[str, Frame]) -> NDArray[np.bool_]:
        """Silhouette (h, w) bool of a frame (H, W, 3) uint8, BGR, by camera name."""
        soft = self._silhouettes.soft(frames)[self._name]
        person = find_person(soft.silhouette)
        if person is None:
            return soft.silhouette
        sure = self._silhouettes.of_colours(frames, self._density, JOINING.sure)[self._name].likely
        differs = soft.silhouette | soft.tint | soft.brightness
        pieces = sure | soft.silhouette
        return soft.silhouette | joined_silhouette(person.mask, pieces, differs)


def joined_silhouette(
    silhouette: NDArray[np.bool_], pieces: NDArray[np.bool_], differs: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Silhouette (h, w) bool with the pieces that something joins to it.

    Args:
        silhouette: (h, w) bool, of the person, not empty.
        pieces: (h, w) bool, what is the person or another thing for sure.
        differs: (h, w) bool, wherever the picture differs from the background.

    Returns:
        The silhouette, and each of the pieces apart from it and no larger that `differs`
        connects with its nearest part within the convex hull of both, with that connection.
    """
    joined = silhouette.copy()
    height = cv2.boundingRect(silhouette.view(np.uint8))[3]
    apart = cv2.morphologyEx((pieces & ~silhouette).view(np.uint8), cv2.MORPH_OPEN, _THIN)
    least, most = np.array(JOINING.areas) * np.count_nonzero(silhouette)
    count, labels, facts, _ = cv2.connectedComponentsWithStats(apart)
    for k in range(1, count):
        wide = facts[k, cv2.CC_STAT_WIDTH] > JOINING.widest * height
        if wide or not least <= facts[k, cv2.CC_STAT_AREA] <= most:
            continue
        piece = labels == k
        away = cv2.distanceTransform((~piece).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
        gap = float(away[silhouette].min())
        if not JOINING.gaps[0] * height <= gap <= JOINING.gaps[1] * height:
            continue
        near = silhouette & (away <= gap + JOINING.strip * height)
        hull = np.zeros(silhouette.shape, np.uint8)
        ends = np.argwhere(piece | near)[:, ::-1].astype(np.int32)
        cv2.fillConvexPoly(hull, cv2.convexHull(ends), 1)
        between = cv2.connectedComponents(((differs | piece) & (hull > 0)).view(np.uint8))[1]
        both = np.intersect1d(between[near], between[piece])
        joined |= np.isin(between, both[both > 0])
    return joined
