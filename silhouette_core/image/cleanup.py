"""Tidies a silhouette: specks, pinholes, and what lies outside the region of interest."""

import cv2
import numpy as np


def clean(
    mask: np.ndarray, *, min_area_px: int = 0, min_share: float = 0.0, max_hole_px: int = 0, region: np.ndarray | None = None
) -> np.ndarray:
    """Removes small components, fills small holes and keeps to a region.

    A hole is a background component that does not touch the image's edge. Large ones stay: the gap between an arm and the
    trunk is background too.

    Args:
        mask: silhouette, (H, W) bool.
        min_area_px: components (8-connected) with fewer pixels are removed.
        min_share: components with a smaller share of the largest one's pixels are removed.
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
    if min_area_px > 1 or min_share > 0:
        kept = _large_components(kept, min_area_px, min_share)
    if max_hole_px > 0:
        _fill_holes(kept, max_hole_px)
    return kept


def _large_components(mask: np.ndarray, min_area_px: int, min_share: float) -> np.ndarray:
    labels, stats = _components(mask, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA]
    least = max(min_area_px, min_share * area[1:].max(initial=0))
    kept = np.zeros_like(mask)
    for label in range(1, len(stats)):
        if area[label] >= least:
            left, top, width, height = stats[label, :4]
            place = slice(top, top + height), slice(left, left + width)
            kept[place] |= labels[place] == label
    return kept


def _fill_holes(mask: np.ndarray, max_hole_px: int) -> None:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return
    # One pixel around the silhouette is enough to tell a hole, which does not reach it, from the surroundings, which do.
    inner = mask[max(rows[0] - 1, 0) : rows[-1] + 2, max(columns[0] - 1, 0) : columns[-1] + 2]
    labels, stats = _components(~inner, connectivity=4)
    for label in range(1, len(stats)):
        left, top, width, height, area = stats[label]
        at_edge = left == 0 or top == 0 or left + width == inner.shape[1] or top + height == inner.shape[0]
        if area <= max_hole_px and not at_edge:
            place = slice(top, top + height), slice(left, left + width)
            inner[place] |= labels[place] == label


def _components(mask: np.ndarray, connectivity: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns labels (H, W) int32 and a row of left, top, width, height, area per label; label 0 is where mask is not."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=connectivity, ltype=cv2.CV_32S)
    return np.asarray(labels), np.asarray(stats)
