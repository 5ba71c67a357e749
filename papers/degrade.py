"""Degradation of silhouettes, as by worse cameras and backgrounds: rough contours and holes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Degradation:
    """Degradation of a silhouette. Lengths in pixels of the recording.

    Attributes:
        contour_px: standard deviation of the contour's displacement.
        grain_px: standard deviation of the Gaussian that smooths the displacement along the
            contour.
        holes: number of round holes.
        hole_radius_px: of each hole.
    """

    contour_px: float = 0.0
    grain_px: float = 4.0
    holes: int = 0
    hole_radius_px: float = 0.0

    def __str__(self) -> str:
        """Description."""
        words = []
        if self.contour_px:
            words.append(f"contour moved by {self.contour_px:g} px (grain {self.grain_px:g} px)")
        if self.holes:
            words.append(f"{self.holes} holes of radius {self.hole_radius_px:g} px")
        return ", ".join(words) or "as found"


def degrade(
    mask: NDArray[np.bool_], degradation: Degradation, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Degraded silhouette.

    Args:
        mask: (h, w) bool.
        degradation: kind and size.
        rng: source of the random positions.

    Returns:
        (h, w) bool.
    """
    degraded = mask.copy()
    if degradation.contour_px > 0 and mask.any() and not mask.all():
        pixels = mask.astype(np.uint8)
        # Half a pixel less, so that both sides of the contour are at the same distance from it.
        inside = cv2.distanceTransform(pixels, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
        outside = cv2.distanceTransform(1 - pixels, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
        noise = rng.standard_normal(mask.shape).astype(np.float32)
        noise = cv2.GaussianBlur(noise, (0, 0), degradation.grain_px)
        amplitude = degradation.contour_px / float(noise.std())
        degraded = np.where(mask, inside, -outside) + amplitude * noise > 0
    pixels = np.argwhere(mask)
    if degradation.holes and len(pixels):
        holes, radius = np.zeros(mask.shape, np.uint8), round(degradation.hole_radius_px)
        for row, column in pixels[rng.integers(len(pixels), size=degradation.holes)].tolist():
            cv2.circle(holes, (column, row), radius, 1, cv2.FILLED)
        degraded &= holes == 0
    return degraded
