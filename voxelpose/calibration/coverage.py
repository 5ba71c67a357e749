"""Picture of the corners used for the lens calibration of each camera."""

import numpy as np

from voxelpose.calibration.lenses import Lens
from voxelpose.view.images.canvas import (
    FAINT,
    INK,
    LEFT,
    PAPER,
    WARNING,
    Image,
    dot,
    stroke,
    text_width,
    write_text,
)

_PANEL = 460  # longer side, px
_MARGIN, _HEAD, _FOOT = 24, 66, 34
_ACROSS = 4
_EMPTY = (48, 40, 70)
_FILLED = (66, 56, 48)


def coverage_picture(lenses: list[Lens]) -> Image:
    """Used corners of every camera, (H, W, 3) uint8 BGR; cells of the image without any are red."""
    panels = [_panel(lens) for lens in lenses]
    rows = [panels[start : start + _ACROSS] for start in range(0, len(panels), _ACROSS)]
    width = max(sum(panel.shape[1] for panel in row) for row in rows)
    height = sum(max(panel.shape[0] for panel in row) for row in rows)
    picture = np.full((height, width, 3), PAPER, np.uint8)
    y = 0
    for row in rows:
        x = 0
        for panel in row:
            picture[y : y + panel.shape[0], x : x + panel.shape[1]] = panel
            x += panel.shape[1]
        y += max(panel.shape[0] for panel in row)
    return picture


def _panel(lens: Lens) -> Image:
    """Draws one camera."""
    intrinsics = lens.intrinsics
    scale = _PANEL / max(intrinsics.size)
    width, height = (round(side * scale) for side in intrinsics.size)
    used = lens.used()
    detail = (
        f"{intrinsics.rms_px:.2f} px in {len(used)} pictures, focal length"
        f" {intrinsics.matrix[0, 0]:.0f} px"
    )
    across = max(width, text_width(detail, 15), text_width(_LEGEND, 13)) + 2 * _MARGIN
    panel = np.full((height + _HEAD + _FOOT, across, 3), PAPER, np.uint8)
    write_text(panel, lens.camera, _MARGIN, 30, 20, INK, bold=True)
    write_text(panel, detail, _MARGIN, 54, 15, FAINT)
    image = panel[_HEAD : _HEAD + height, _MARGIN : _MARGIN + width]
    cells = len(intrinsics.coverage)
    edges_x, edges_y = (
        np.round(np.linspace(0, side, cells + 1)).astype(int) for side in (width, height)
    )
    for row, column in np.ndindex(intrinsics.coverage.shape):
        image[edges_y[row] : edges_y[row + 1], edges_x[column] : edges_x[column + 1]] = (
            _FILLED if intrinsics.coverage[row, column] else _EMPTY
        )
    for view in used.values():
        for pixel in view.pixels:
            dot(image, (pixel + 0.5) * scale - 0.5, 1.8, LEFT)
    middle = (intrinsics.matrix[:2, 2] + 0.5) * scale - 0.5
    for arm in np.array([[7.0, 0], [0, 7.0]]):
        stroke(image, np.array([middle - arm, middle + arm]), INK)
    border = np.array(
        [[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], dtype=float
    )
    stroke(image, border, FAINT, closed=True)
    write_text(
        panel,
        _LEGEND,
        _MARGIN,
        height + _HEAD + 22,
        13,
        WARNING if (intrinsics.coverage == 0).any() else FAINT,
    )
    return panel


_LEGEND = "dots: corners used   red: none here   cross: optical centre"
