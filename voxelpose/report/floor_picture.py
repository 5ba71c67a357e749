"""The fitted body with its skeleton on the floor, seen from its left and above."""

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.motion import kinematics
from silhouette_core.motion.gait_values import Gait
from silhouette_core.motion.motion import Motion
from voxelpose.view.images import canvas
from voxelpose.view.images.figure import FigurePainter

SIZE = 720, 600
"""Width and height, px."""
_FLOOR, _GRID = (84, 74, 66), (128, 116, 106)  # BGR
_ROOM = (52, 44, 38)
_TILES = 3  # of half a metre, on each side


def telling_row(motion: Motion, gait: Gait | None) -> int:
    """Row of a motion, of at least one pose, that shows it: of a gait its middle contact, else
    where outlines agree best.
    """
    if gait is not None:
        contacts = sorted(time for times in gait.contacts_s.values() for time in times)
        return int(np.abs(motion.time_s - contacts[len(contacts) // 2]).argmin())
    agreement = motion.quality.get("outline_agreement")
    if agreement is None:
        return len(motion) // 2
    return int(np.nan_to_num(np.asarray(agreement, float)).argmax())


def floor_picture(motion: Motion, row: int) -> canvas.Image:
    """Picture (600, 720, 3) uint8 BGR of a pose on the floor, whose tiles are half a metre wide."""
    upright = motion.upright().select(np.array([row]))
    rotation, origin = (array[0] for array in upright.parts())
    skin = kinematics.skin(upright.model, rotation, origin)
    middle = np.r_[0.5 * (skin.min(axis=0) + skin.max(axis=0))[:2], 0.0]
    reach = float(np.linalg.norm(skin - middle, axis=1).max())
    camera = _camera(middle, -rotation[0, :2, 1], reach)
    picture = np.full((SIZE[1], SIZE[0], 3), _ROOM, np.uint8)
    corners = middle + 0.5 * _TILES * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    canvas.tint(picture, [camera.project(corners)[0]], _FLOOR, 1.0)
    steps = np.linspace(-0.5 * _TILES, 0.5 * _TILES, 2 * _TILES + 1)
    ends = np.array([[(x, -0.5 * _TILES, 0), (x, 0.5 * _TILES, 0)] for x in steps])
    lines = middle + np.concatenate([ends, ends[..., [1, 0, 2]]])
    canvas.segments(picture, camera.project(lines.reshape(-1, 3))[0].reshape(-1, 2, 2), _GRID)
    return FigurePainter(motion.model, camera).paint(picture, rotation, origin)


def _camera(middle: NDArray[np.float64], ahead: NDArray[np.float64], reach_m: float) -> Camera:
    """Camera that looks at a body of a reach about its place on the floor."""
    forward = np.r_[ahead, 0.0] / max(float(np.linalg.norm(ahead)), 1e-9)
    aside = np.cross([0.0, 0.0, 1.0], forward)
    # From its left, 30 degrees to the front, which shows steps, and about 20 degrees from above.
    turn, rise = np.radians([30, 20])
    toward = np.sin(turn) * forward + np.cos(turn) * aside + np.array([0, 0, np.tan(rise)])
    centre = middle + np.array([0, 0, reach_m / 2])
    distance = 4 * reach_m
    eye = centre + distance * toward / np.linalg.norm(toward)
    look = (centre - eye) / distance
    right = np.cross(look, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(look, right), look])
    width, tall = SIZE
    # The reach and a tenth more fill the picture's height.
    focal = 0.9 * tall * distance / reach_m
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (tall - 1) / 2], [0, 0, 1.0]])
    return Camera("view", SIZE, matrix, np.zeros(5), rotation, -rotation @ eye)
