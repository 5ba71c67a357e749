"""Up and the floor: what may be up, and a grid on the floor as the cameras see it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.points import triangulate
from calib.upright import AXES, UprightFrame, axis_name, cameras_worth, up_candidates


def up_choices(rig: Rig) -> list[dict[str, Any]]:
    """Directions that may be up, by `name` as for --up and `worth`, 0 to 1; the axes first."""
    choices = [{"name": name, "worth": cameras_worth(rig, up)} for name, up in AXES.items()]
    for up in up_candidates(rig):
        if all(up @ axis < 0.9999 for axis in AXES.values()):
            choices.append({"name": axis_name(up), "worth": cameras_worth(rig, up)})
    return choices


def ground_lines(rig: Rig, frame: UprightFrame) -> dict[str, list[dict[str, Any]]]:
    """The floor's grid, the world's axes and an upright pole of 1.8 m as the cameras see them.

    Args:
        rig: as calibrated.
        frame: with the floor at z = 0.

    Returns:
        By camera, lines with `kind` (grid, middle, x, y, z, pole) and `pixels` [[x, y], ...].
    """
    upright = frame.rig(rig)
    x, y = _middle(upright)
    lines: list[tuple[str, NDArray[np.float64]]] = []
    for offset in np.linspace(-3, 3, 13).tolist():  # metres, a line every half
        kind = "grid" if offset else "middle"
        across = np.array([[x - 3, y + offset, 0], [x + 3, y + offset, 0]])
        along = np.array([[x + offset, y - 3, 0], [x + offset, y + 3, 0]])
        lines += [(kind, across), (kind, along)]
    lines.append(("pole", np.array([[x, y, 0], [x, y, 1.8]])))
    drawn: dict[str, list[dict[str, Any]]] = {camera.name: [] for camera in rig}
    for camera in upright:
        for kind, ends in lines:
            drawn[camera.name] += _seen(camera, kind, ends)
    for camera in rig:
        for kind, axis in zip("xyz", np.eye(3), strict=True):
            drawn[camera.name] += _seen(camera, kind, np.array([np.zeros(3), axis]))
    return drawn


def _middle(rig: Rig) -> tuple[float, float]:
    """Point of the floor, to whole metres, below what all cameras look at."""
    place = triangulate(list(rig), np.array([camera.matrix[:2, 2] for camera in rig]))
    if len(rig) == 1:  # where its optical axis meets the floor, if near
        camera = rig.cameras[0]
        down = -camera.rotation[2][2]
        reach = camera.center_m[2] / down if down > 0.05 else 4.0
        place = camera.center_m + camera.rotation[2] * float(np.clip(reach, 1.0, 20.0))
    x, y = np.rint(place[:2]).tolist()
    return x, y


def _seen(camera: Camera, kind: str, ends: NDArray[np.float64]) -> list[dict[str, Any]]:
    """The pieces of a line that a camera sees."""
    count = int(np.linalg.norm(ends[1] - ends[0]) / 0.1) + 1  # pieces of 10 cm: lenses bend lines
    share = np.linspace(0, 1, count)[:, None]
    pixels, _ = camera.project(ends[0] + share * (ends[1] - ends[0]))
    most = 4.0 * max(camera.size)
    near = np.abs(np.nan_to_num(pixels, nan=np.inf)).max(axis=1) < most
    pieces, run = [], []
    for pixel, is_near in zip(pixels.tolist(), [*near.tolist(), False], strict=False):
        if is_near:
            run.append([round(pixel[0], 2), round(pixel[1], 2)])
            continue
        pieces.append(run)
        run = []
    pieces.append(run)
    return [{"kind": kind, "pixels": piece} for piece in pieces if len(piece) > 1]
