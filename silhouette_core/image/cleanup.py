"""Tidies a silhouette: specks, pinholes, and what lies outside the region of interest."""

import cv2
import numpy as np


def clean(mask: np.ndarray, *, min_area_px: int = 0, max_hole_px: int = 0, region: np.ndarray | None = None) -> np.ndarray:
    """Removes small components, fills small holes and keeps to a region.

    A hole is a background component that does not touch the image's edge. Large ones stay: the gap between an arm and the
    trunk is background too.

    Args:
        mask: silhouette, (H, W) bool.
        min_area_px: components (8-connected) with fewer pixels are removed.
        max_hole_px: holes (4-connected) with at most so many pixels are filled.
        region: region of interest, (H, W) bool; nothing outside it is kept. None means the whole image.

    Returns:
        A new mask, (H, W) bool.

    Raises:
        TypeError: mask or region is not (H, W) bool of one size.
    """
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise TypeError(f"mask must be (H, W) bool, got {mask.shape} {mask.dtype}")
    if region is not None and (region.shape != mask.shape or region.dtype != np.bool_):
        raise TypeError(f"region must be {mask.shape} bool like the mask, got {region.shape} {region.dtype}")
    kept = mask.copy() if region is None else mask & region
    if min_area_px > 1:
        kept = _large_components(kept, min_area_px, connectivity=8)
    if max_hole_px > 0:
        kept = ~_large_components(~kept, max_hole_px + 1, connectivity=4, keep_touching_edge=True)
    return kept


def _large_components(mask: np.ndarray, min_area_px: int, connectivity: int, keep_touching_edge: bool = False) -> np.ndarray:
    height, width = mask.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=connectivity, ltype=cv2.CV_32S)
    keep = stats[:, cv2.CC_STAT_AREA] >= min_area_px
    if keep_touching_edge:
        left, top = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_TOP]
        right, bottom = left + stats[:, cv2.CC_STAT_WIDTH], top + stats[:, cv2.CC_STAT_HEIGHT]
        keep |= (left == 0) | (top == 0) | (right == width) | (bottom == height)
    keep[0] = False
    return keep[labels]
