"""The room in the page: floor, person, cameras, hull, other likely poses."""

from collections.abc import Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_BONES
from voxelpose.live.camera_views import CameraViews
from voxelpose.live.live_frame import LiveFrame, PosedBody
from voxelpose.live.skinned_figure import SkinnedFigure
from voxelpose.view.viewer.legend import HULL, HYPOTHESIS, faded

LAYERS = {
    "figure": "Person",
    "cameras": "Cameras",
    "pictures": "Pictures",
    "outlines": "Outlines",
    "hull": "Voxels",
    "hypotheses": "Other poses",
}
"""What can be shown, and how the page calls it: `pictures` of the cameras with silhouettes as
`outlines`, `hypotheses` of one camera.
"""
_MOST_HYPOTHESES = 3
_MOST_POINTS = 4000
_SKY = (205, 214, 224), (247, 248, 249)  # from top to bottom
_NO_POINTS = np.zeros((0, 3), np.float32)


class LiveScene:
    """The nodes of viser's scene."""

    def __init__(self, server: viser.ViserServer, rig: Sequence[Camera]) -> None:
        """Makes the room.

        Args:
            server: whose scene it is.
            rig: at least one camera.
        """
        scene = server.scene
        centers = np.array([camera.center_m for camera in rig])
        middle = _looked_at(rig)
        scene.set_up_direction("+z")
        scene.set_background_image(np.linspace(*_SKY, 64)[:, None].astype(np.uint8), format="png")
        scene.configure_environment_map(None)  # reflections cost more than they show
        scene.configure_default_lights(cast_shadow=True)
        scene.add_light_ambient("/light", intensity=2.0)
        extent = max(6.0, 2.4 * float(np.abs(centers[:, :2] - middle[:2]).max()))
        scene.add_grid(
            "/floor",
            extent,
            extent,
            position=(float(middle[0]), float(middle[1]), 0.0),
            cell_size=0.5,
            cell_color=(216, 220, 224),
            section_color=(176, 182, 190),
            plane_color=(244, 245, 246),
            plane_opacity=1.0,
            shadow_opacity=0.25,
        )
        self._figure = SkinnedFigure(scene)
        self._cameras = CameraViews(scene, rig)
        self._hull = scene.add_point_cloud(
            "/hull", _NO_POINTS, HULL, point_size=0.012, point_shape="circle"
        )
        self._hypotheses = scene.add_line_segments(
            "/hypotheses",
            np.zeros((1, 2, 3), np.float32),
            HYPOTHESIS,
            thickness=0.008,
            visible=False,
        )
        self._drawn: frozenset[str] | None = None
        self._count = 0
        _place_viewpoint(server, centers, middle)

    def draw(self, frame: LiveFrame, shown: frozenset[str]) -> None:
        """Shows the chosen `LAYERS` of one moment."""
        pictures = {"cameras", "pictures"} <= shown
        if shown != self._drawn:
            self._cameras.show("cameras" in shown)
            if not pictures:
                self._cameras.clear()
            self._drawn = shown
        self._figure.draw(frame.body if "figure" in shown else None)
        self._draw_hypotheses(frame.body if "hypotheses" in shown else None)
        self._count += 1
        if self._count % 2:  # hull and pictures cost the most, and may lag a little
            self._draw_hull(frame.body if "hull" in shown else None)
        elif pictures:
            self._cameras.draw(frame, "outlines" in shown)

    def _draw_hull(self, body: PosedBody | None) -> None:
        points = _NO_POINTS if body is None or body.hull_m is None else body.hull_m
        if len(points) == len(self._hull.points) == 0:
            return
        step = -(-len(points) // _MOST_POINTS) or 1
        self._hull.points = np.ascontiguousarray(points[::step], np.float32)

    def _draw_hypotheses(self, body: PosedBody | None) -> None:
        likeliest = () if body is None else body.hypotheses[:_MOST_HYPOTHESES]
        self._hypotheses.visible = bool(likeliest)
        if not likeliest:
            return
        ends = np.concatenate([joints[LANDMARK_BONES] for _, joints in likeliest])
        shades = [faded(probability / max(likeliest[0][0], 1e-9)) for probability, _ in likeliest]
        colours = np.repeat(np.repeat(shades, len(LANDMARK_BONES), 0)[:, None], 2, 1)
        seen = np.isfinite(ends).all((1, 2))
        self._hypotheses.points = ends[seen].astype(np.float32)
        self._hypotheses.colors = colours[seen]


def _looked_at(rig: Sequence[Camera]) -> NDArray[np.float64]:
    """Point (3,) nearest to all optical axes, at 1 m height; of one camera, 3 m before it."""
    centers = np.array([camera.center_m for camera in rig])
    axes = np.array([camera.rotation[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    # A weak pull toward 3 m before each camera decides where the axes are parallel.
    pull = 0.01
    ahead = centers + 3.0 * axes
    normal = across.sum(0) + pull * len(rig) * np.eye(3)
    point = np.linalg.solve(normal, np.einsum("cij,cj->i", across, centers) + pull * ahead.sum(0))
    return np.array([point[0], point[1], 1.0])


def _place_viewpoint(
    server: viser.ViserServer, centers: NDArray[np.float64], middle: NDArray[np.float64]
) -> None:
    """Puts the viewpoint above and beside the first camera, where no camera hides the person."""
    toward = centers[0] - middle
    beside = np.array([toward[0] - 0.6 * toward[1], toward[1] + 0.6 * toward[0], 0.0])
    length = float(np.linalg.norm(beside))
    distance = np.clip(1.5 * np.linalg.norm(toward[:2]), 4.0, 8.0)
    server.initial_camera.look_at = middle - (0, 0, 0.1)
    server.initial_camera.position = middle + beside * distance / max(length, 1e-9) + (0, 0, 2.2)
    server.initial_camera.fov = float(np.radians(50))
