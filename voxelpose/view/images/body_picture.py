"""Pictures of bodies at rest and bent, drawn by the project's own rasteriser."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from voxelpose.view.images.canvas import Image, text_width, write_text
from voxelpose.view.images.hull_picture import shaded_view

_FRONT, _QUARTER, _SIDE = -90, -50, 0  # azimuths, degrees
_CAPTION_PX, _LINE_PX, _MARGIN_PX = 14, 20, 8
_CAPTION = (60, 52, 46)  # BGR
_MOST_COLUMNS = 8
# A pose that bends every large joint: a lunge with one arm forward and one raised, degrees.
_BENT_DEG = {
    "left_thigh.flexion": 85,
    "left_shin.flexion": 90,
    "left_foot.dorsiflexion": 10,
    "right_thigh.flexion": -10,
    "right_shin.flexion": 70,
    "right_foot.dorsiflexion": -20,
    "lumbar.flexion": 20,
    "thorax.flexion": 15,
    "thorax.rotation": 20,
    "neck.flexion": -15,
    "left_upper_arm.abduction": 75,
    "left_forearm.flexion": 100,
    "right_upper_arm.forward": 70,
    "right_forearm.flexion": 60,
    "right_hand.flexion": 30,
}


def body_picture(body: BodyModel) -> Image:
    """A body at rest from the front, obliquely and the side, and bent: (h, w, 3) uint8, BGR."""
    rest, bent, size = body.vertices_m, bent_vertices(body), (420, 500)
    views = [_standing(rest, body, azimuth, rest, size) for azimuth in (_FRONT, _QUARTER, _SIDE)]
    return np.concatenate([*views, _standing(bent, body, _QUARTER, rest, size)], axis=1)


def bodies_picture(bodies: Sequence[BodyModel], captions: Sequence[str]) -> Image:
    """Several bodies from the front, all at the same scale and on the same floor: (h, w, 3) uint8,
    BGR, in rows of at most eight.

    Args:
        bodies: at least one.
        captions: two lines of text for each, separated by a newline.
    """
    size = 230, 270
    tallest = max((body.vertices_m for body in bodies), key=lambda v: float(np.ptp(v[:, 2])))
    cells = []
    for body, caption in zip(bodies, captions, strict=True):
        view = _standing(body.vertices_m, body, _FRONT, tallest, size)
        lines = caption.split("\n")
        under = np.full((len(lines) * _LINE_PX + _MARGIN_PX, size[0], 3), view[0, 0], np.uint8)
        for k, line in enumerate(lines):
            left = max((size[0] - text_width(line, _CAPTION_PX)) // 2, 0)
            write_text(under, line, left, (k + 1) * _LINE_PX - 4, _CAPTION_PX, _CAPTION)
        cells.append(np.concatenate([view, under]))
    columns = min(len(cells), _MOST_COLUMNS)
    blank = np.full_like(cells[0], cells[0][0, 0])
    cells += [blank] * (-len(cells) % columns)
    rows = [cells[k : k + columns] for k in range(0, len(cells), columns)]
    return np.concatenate([np.concatenate(row, axis=1) for row in rows])


def bent_vertices(body: BodyModel) -> NDArray[np.float64]:
    """Vertices (V, 3) of a body in a pose that bends its large joints, m."""
    angles = np.zeros((1, body.dof_count))
    for name, degrees in _BENT_DEG.items():
        angles[0, body.dof_names.index(name)] = np.radians(degrees)
    rotation, origin = kinematics.forward(
        body, body.joints_m[:1], np.array([[1.0, 0.0, 0.0, 0.0]]), angles
    )
    return kinematics.skin(body, rotation[0], origin[0])


def _standing(
    vertices: NDArray[np.float64],
    body: BodyModel,
    azimuth_deg: float,
    largest: NDArray[np.float64],
    size: tuple[int, int],
) -> Image:
    """One picture, in a frame in which the largest body just fits, on a common floor."""
    floor = np.array([0.0, 0.0, vertices[:, 2].min()])
    reach = np.abs(largest[:, :2]).max()
    box = np.array([-reach, -0.1, 0.0]), np.array([reach, 0.1, np.ptp(largest[:, 2])])
    middle = np.r_[0.5 * (vertices.min(0) + vertices.max(0))[:2], 0.0]
    return shaded_view((vertices - floor - middle, body.faces), box, None, azimuth_deg, size)
