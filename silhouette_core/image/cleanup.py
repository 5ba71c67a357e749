"""Silhouettes without specks and pinholes, cropped to a region of interest, widened, halved."""

import cv2
import numpy as np

from calib.checks import BoolArray, check_array
from calib.components import label_components


def clean(
    mask: np.ndarray,
    *,
    min_area_px: int = 0,
    min_share: float = 0.0,
    max_hole_px: int = 0,
    region: np.ndarray | None = None,
) -> np.ndarray:
    """Silhouette without small components, small holes and what lies outside a region.

    A hole is a background component that does not touch the image's edge. Large ones stay: the gap
    between an arm and the trunk is background too. Raises TypeError where mask or region is not
    bool; ValueError where mask and region are not (H, W) of one size.

    Args:
        mask: (H, W) bool, silhouette.
        min_area_px: components (8-connected) with fewer pixels are removed.
        min_share: components with a smaller fraction of the largest one's pixels are removed.
        max_hole_px: holes (4-connected) with at most this many pixels are filled.
        region: (H, W) bool, region of interest; None means the whole image.

    Returns:
        (H, W) bool, a new mask.
    """
    check_array("mask", mask, ("H", "W"), np.bool_)
    if region is not None:
        check_array("region", region, mask.shape, np.bool_)
    cleaned = mask.copy() if region is None else mask & region
    if min_area_px > 1 or min_share > 0:
        cleaned = _large_components(cleaned, min_area_px, min_share)
    if max_hole_px > 0:
        _fill_holes(cleaned, max_hole_px)
    return cleaned


def _large_components(mask: np.ndarray, min_area_px: int, min_share: float) -> np.ndarray:
    """Mask (H, W) of the components that are large enough."""
    components = label_components(mask)
    sizes = components.sizes
    large = sizes >= max(1, min_area_px, min_share * sizes.max())
    return large.take(components.labels, mode="clip")  # faster than with bounds checks


def _fill_holes(mask: np.ndarray, max_hole_px: int) -> None:
    """Fills small holes in place."""
    if not mask.any():
        return
    # A rim of one pixel around the silhouette distinguishes its surroundings, which reach that rim,
    # from holes, which do not.
    inner = mask[bounding_box(mask, 1)]
    background = label_components(~inner, diagonal=False)
    labels = background.labels
    small = background.sizes <= max_hole_px
    for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        small[edge] = False
    small[0] = True  # the silhouette itself
    inner[:] = small.take(labels, mode="clip")


def bounding_box(mask: BoolArray, margin: int = 0) -> tuple[slice, slice]:
    """Rows and columns of the box about a mask (H, W) bool and a margin, px; all if it is empty."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(None), slice(None)
    return (
        slice(max(int(rows[0]) - margin, 0), int(rows[-1]) + margin + 1),
        slice(max(int(columns[0]) - margin, 0), int(columns[-1]) + margin + 1),
    )


def dilated(mask: BoolArray, side_px: int) -> BoolArray:
    """Mask (h, w) bool widened by a square of so many pixels, an odd number."""
    square = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.dilate(mask.view(np.uint8), square), np.uint8).view(np.bool_)


def opened(mask: BoolArray, side_px: int) -> BoolArray:
    """Mask (h, w) bool without what is thinner than so many pixels."""
    square = np.ones((side_px, side_px), np.uint8)
    thick = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, square)
    return np.asarray(thick, np.uint8).view(np.bool_)


def pieces_with(mask: BoolArray, points: BoolArray) -> BoolArray:
    """Components of a mask (h, w) bool that hold one of some places (h, w) bool."""
    components = label_components(mask)
    wanted = np.zeros(len(components.sizes), np.bool_)
    wanted[components.labels[mask & points]] = True
    return wanted[components.labels]


def reduce_silhouette(mask: BoolArray) -> BoolArray:
    """Silhouette (…, h, w) bool at half the resolution: at least two of four pixels are set.

    Observations must be reduced in the same way.
    """
    a, b, c, d = (mask[..., y::2, x::2] for y in range(2) for x in range(2))
    return (a & b) | (c & d) | ((a | b) & (c | d))
