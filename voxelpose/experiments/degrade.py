"""Silhouettes as worse cameras and backgrounds give them: rough contours and holes of stated size."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Degradation:
    """What is done to a silhouette. Lengths in pixels of the recording.

    Attributes: contour_px: standard deviation by which the contour is moved in and out. grain_px:
        how long the bumps along it are (standard deviation of the Gaussian that smooths the noise).
        holes: how many round holes. hole_radius_px: of each.
    """

    contour_px: float = 0.0
    grain_px: float = 4.0
    holes: int = 0
    hole_radius_px: float = 0.0

    def __str__(self) -> str:
        """Says it in words."""
        words = []
        if self.contour_px:
            words.append(f"contour moved by {self.contour_px:g} px (grain {self.grain_px:g} px)")
        if self.holes:
            words.append(f"{self.holes} holes of radius {self.hole_radius_px:g} px")
        return ", ".join(words) or "as found"


def degrade(
    mask: NDArray[np.bool_], degradation: Degradation, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Spoils a silhouette.

    Args:
        mask: (h, w) bool.
        degradation: how.
        rng: decides where; the same gives the same.

    Returns:
        (h, w) bool.
    """
    spoilt = mask.copy()
    if degradation.contour_px > 0 and mask.any() and not mask.all():
        pixels = mask.astype(np.uint8)
        # Half a pixel each, so that both sides of the contour are equally far from it.
        inside = cv2.distanceTransform(pixels, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
        outside = cv2.distanceTransform(1 - pixels, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
        noise = cv2.GaussianBlur(
            rng.standard_normal(mask.shape).astype(np.float32), (0, 0), degradation.grain_px
        )
        spoilt = (
            np.where(mask, inside, -outside) + degradation.contour_px / float(noise.std()) * noise
            > 0
        )
    places = np.argwhere(mask)
    if degradation.holes and len(places):
        holes = np.zeros(mask.shape, np.uint8)
        for row, column in places[rng.integers(len(places), size=degradation.holes)]:
            cv2.circle(
                holes, (int(column), int(row)), round(degradation.hole_radius_px), 1, cv2.FILLED
            )
        spoilt &= holes == 0
    return spoilt
