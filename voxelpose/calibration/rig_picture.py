"""Picture of a rig from above and from the side: cameras, their common volume, and the floor."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, FloatArray, Rig
from calib.points import nearest_point
from calib.upright import UprightFrame, up_candidates
from voxelpose.view.images.canvas import (
    FAINT,
    INK,
    LEFT,
    MIDDLE,
    PAPER,
    RIGHT,
    Image,
    dot,
    stroke,
    text_width,
    write_text,
)

_PANEL, _MARGIN, _HEAD, _GAP, _FOOT = 640, 48, 84, 56, 44
_CELLS = 72  # along the longest edge
_LINE = (52, 45, 40)
_SEEN = (96, 84, 62)  # colour of the volume seen by all cameras
_MOST_LINES = 50


@dataclass(frozen=True)
class _Panel:
    """One orthographic view, with the world's x to the right."""

    up: int  #: World axis that points up.
    low: FloatArray  #: (3,) float64, m, world point at the lower left corner.
    scale: float  #: px per m.
    left_px: float  #: Column of that corner in the picture.
    bottom_px: float  #: Row of that corner in the picture.

    def at(self, points: FloatArray) -> FloatArray:
        """Pixels (N, 2) of world points (N, 3)."""
        return np.column_stack(
            [
                self.left_px + (points[:, 0] - self.low[0]) * self.scale,
                self.bottom_px - (points[:, self.up] - self.low[self.up]) * self.scale,
            ]
        )


def rig_picture(rig: Rig, floor: bool = True) -> Image:
    """Picture of a rig, (H, W, 3) uint8 BGR: from above on the left, from the side on the right.

    Args:
        floor: Whether the world's z is the height above the floor; if not, what is up for the
            cameras is drawn upward.
    """
    rig = rig if floor else UprightFrame.from_up(up_candidates(rig)[0]).rig(rig)
    low, high = _extent(rig, floor)
    edges = high - low
    scale, spacing = _PANEL / edges.max(), _spacing_m(float(edges.max()))
    width, height = (
        2 * _MARGIN + _GAP + round(2 * edges[0] * scale),
        _HEAD + _FOOT + round(max(edges[1], edges[2]) * scale),
    )
    picture = np.full((height, max(width, 860), 3), PAPER, np.uint8)
    above = _Panel(1, low, scale, _MARGIN, height - _FOOT)
    side = _Panel(2, low, scale, _MARGIN + edges[0] * scale + _GAP, height - _FOOT)
    counts = _counts(rig, low, high, floor)
    for panel, count, title in zip(
        (above, side), counts, ("from above", "from the side"), strict=True
    ):
        _shade(picture, panel, count, high, len(rig))
        _grid(picture, panel, high, spacing)
        write_text(
            picture, title, round(panel.left_px), round(panel.at(high[None])[0, 1]) - 12, 16, FAINT
        )
        if floor and panel is side:
            ends = panel.at(np.array([[low[0], 0, 0], [high[0], 0, 0]]))
            stroke(picture, ends, MIDDLE, 2)
            write_text(
                picture,
                "floor",
                round(ends[1, 0]) - text_width("floor", 13) - 4,
                round(ends[1, 1]) + 16,
                13,
                MIDDLE,
            )
        if floor:
            for axis, letter in ((0, "x"), (panel.up, "yz"[panel is side])):
                ends = panel.at(np.array([np.zeros(3), 0.08 * edges.max() * np.eye(3)[axis]]))
                stroke(picture, ends, RIGHT, 2)
                write_text(picture, letter, round(ends[1, 0]) + 4, round(ends[1, 1]) - 4, 13, RIGHT)
        for camera in rig:
            _draw(picture, panel, camera, 0.1 * edges.max())
    shade = (
        f"shade: seen by 2 to all {len(rig)} cameras"
        if len(rig) > 2
        else "shade: seen by both cameras"
        if len(rig) == 2
        else "shade: seen"
    )
    caption = shade + (
        "; left: a standing person, from feet to head"
        if floor
        else "; no floor was given: up is a guess, from the cameras"
    )
    every = "metre" if spacing == 1 else f"{spacing} metres"
    title = f"{len(rig)} cameras, a line every {every}"
    write_text(picture, title, _MARGIN, 36, 20, INK, bold=True)
    write_text(picture, caption, _MARGIN, height - 14, 14, FAINT)
    return picture


def _extent(rig: Rig, floor: bool) -> tuple[FloatArray, FloatArray]:
    """Low and high corner, m, of a box around the cameras and the point they look at."""
    centers = np.array([camera.center_m for camera in rig])
    axes = np.array([camera.rotation[2] for camera in rig])
    # The point nearest to all optical axes; limited for almost parallel axes.
    middle = nearest_point(centers, axes)
    depth = max(1.0, float(np.ptp(centers, axis=0).max()))
    middle = np.clip(middle, centers.min(axis=0) - depth, centers.max(axis=0) + depth)
    shown = np.vstack(
        [centers, middle[None], *([np.zeros((1, 3)), [[0, 0, 2.5]]] if floor else [])]
    )
    low, high = shown.min(axis=0), shown.max(axis=0)
    margin = 0.12 * max(float((high - low).max()), 1.0)
    return low - margin, high + margin


def _counts(
    rig: Rig, low: FloatArray, high: FloatArray, floor: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of cameras that see each cell, from above (y, x) and from the side (z, x).

    From above: a person from feet to head if there is a floor, else the maximum over all heights.
    From the side: the maximum over y.
    """
    step = float((high - low).max()) / _CELLS
    x, y, z = (np.arange(low[axis] + step / 2, high[axis], step) for axis in range(3))
    seen = _seen_by(rig, x, y, z)
    person = np.linspace(0.1, 1.8, 6)
    above = _seen_by(rig, x, y, person).min(axis=2) if floor else seen.max(axis=2)
    return above.T, seen.max(axis=1).T


def _seen_by(rig: Rig, x: FloatArray, y: FloatArray, z: FloatArray) -> NDArray[np.int64]:
    """Number (X, Y, Z) int64 of cameras that have each point in their image."""
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    count = np.zeros(len(points), dtype=np.int64)
    for camera in rig:
        pixels, _ = camera.project(points)
        with np.errstate(invalid="ignore"):
            count += ((pixels >= -0.5) & (pixels < np.array(camera.size) - 0.5)).all(axis=1)
    return count.reshape(len(x), len(y), len(z))


def _shade(
    picture: Image, panel: _Panel, count: NDArray[np.int64], high: FloatArray, cameras: int
) -> None:
    """Shades cells seen by two cameras or more, brighter for more cameras."""
    corner = panel.at(high[None])[0]
    left, bottom, right, top = (
        round(panel.left_px),
        round(panel.bottom_px),
        round(corner[0]),
        round(corner[1]),
    )
    least = min(2, cameras)
    fraction = np.where(count >= least, (count - least + 1) / (cameras - least + 1), 0.0)
    fraction = cv2.resize(
        fraction[::-1].astype(np.float32),
        (right - left, bottom - top),
        interpolation=cv2.INTER_NEAREST,
    )[..., None]
    area = picture[top:bottom, left:right]
    area[:] = np.round(area + fraction * (np.array(_SEEN) - area)).astype(np.uint8)


def _spacing_m(extent_m: float) -> int:
    """Distance of the grid's lines: 1, 2, 5, 10, ... m, so that there are few enough to be seen."""
    decade = 1
    while True:
        for spacing in (decade, 2 * decade, 5 * decade):
            if extent_m <= _MOST_LINES * spacing:
                return spacing
        decade *= 10


def _grid(picture: Image, panel: _Panel, high: FloatArray, spacing_m: int) -> None:
    """Draws a grid and the border."""
    low = panel.low
    for axis, other in ((0, panel.up), (panel.up, 0)):
        first, last = np.ceil(low[axis] / spacing_m), np.floor(high[axis] / spacing_m)
        for line in spacing_m * np.arange(first, last + 1):
            ends = np.zeros((2, 3))
            ends[:, axis], ends[:, other] = line, (low[other], high[other])
            stroke(picture, panel.at(ends), _LINE)
    border = np.zeros((4, 3))
    border[:, 0] = np.array([low, high, high, low])[:, 0]
    border[:, panel.up] = np.array([low, low, high, high])[:, panel.up]
    stroke(picture, panel.at(border), FAINT, closed=True)


def _draw(picture: Image, panel: _Panel, camera: Camera, length: float) -> None:
    """Draws a camera as its viewing pyramid, with its name behind it."""
    width, height = camera.size
    corners = np.array(
        [[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], dtype=float
    )
    # Without distortion, because wide lenses may have no rays at the corners.
    rays = camera.pinhole().rays(corners)[1]
    rays /= np.abs(rays @ camera.rotation[2])[:, None]
    ends = panel.at(camera.center_m + length * rays)
    apex = panel.at(camera.center_m[None])[0]
    for end in ends:
        stroke(picture, np.array([apex, end]), LEFT)
    stroke(picture, ends, LEFT, closed=True)
    dot(picture, apex, 4, LEFT)
    back = apex - panel.at((camera.center_m + camera.rotation[2])[None])[0]
    back /= np.linalg.norm(back) + 1e-9
    x = apex[0] + 14 * back[0] - (text_width(camera.name, 14) if back[0] < 0 else 0)
    x = np.clip(x, 2, picture.shape[1] - text_width(camera.name, 14) - 2)
    write_text(picture, camera.name, round(float(x)), round(apex[1] + 14 * back[1] + 5), 14, INK)
