"""The body is drawn where the camera sees it, lens and reduction included."""

import numpy as np
import pytest

from silhouette_core.motion import kinematics
from tests.clips import waving
from tests.sources import ring
from voxelpose.view.images.canvas import LEFT, PAPER, RIGHT
from voxelpose.view.images.figure import FigurePainter

GREY = 90


def painted(camera, scale, row=-1):
    motion = waving()
    rotation, origin = motion.parts()
    painter = FigurePainter(motion.model, camera, scale)
    blank = np.full((camera.size[1], camera.size[0], 3), GREY, np.uint8)
    image = painter.paint(painter.resized(blank), rotation[row], origin[row])
    surface = kinematics.skin(motion.model, rotation[row], origin[row])
    return image, painter, surface, origin[row], motion.model.names


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("distortion", [(), (-0.25, 0.08, 0.002, -0.001)])
def test_figure_fills_the_projected_body(scale, distortion):
    camera = ring(1, (320, 240), distortion).cameras[0]
    image, _, surface, _, _ = painted(camera, scale)
    pixels, _ = camera.project(surface)
    pixels = (pixels + 0.5) * scale - 0.5
    rows, columns = np.nonzero((image != GREY).any(axis=2))
    assert abs(columns.min() - pixels[:, 0].min()) < 3.5
    assert abs(columns.max() - pixels[:, 0].max()) < 3.5
    assert abs(rows.min() - pixels[:, 1].min()) < 3.5
    assert abs(rows.max() - pixels[:, 1].max()) < 3.5


def test_bones_have_their_sides_colour_and_the_right_ones_are_dashed():
    camera = ring(1, (640, 480)).cameras[0]
    image, painter, _, origin, names = painted(camera, 1.0)
    for side, own, dash in (("right", RIGHT, PAPER), ("left", LEFT, LEFT)):
        ends = [names.index(f"{side}_{part}") for part in ("forearm", "hand")]
        elbow, wrist = painter.pixels(origin[ends])
        for share, expected in ((0.5, own), (0.3, dash)):
            column, row = np.round(elbow + share * (wrist - elbow)).astype(int)
            assert np.abs(image[row, column].astype(int) - expected).sum() < 60


def test_body_out_of_sight_leaves_the_picture_alone():
    camera = ring(1, (160, 120)).cameras[0]
    motion = waving()
    rotation, origin = motion.parts()
    painter = FigurePainter(motion.model, camera)
    blank = np.full((120, 160, 3), GREY, np.uint8)
    behind = origin[0] + 3 * (camera.center_m - origin[0, 0])
    assert (painter.paint(blank.copy(), rotation[0], behind) == blank).all()
