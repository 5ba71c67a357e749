"""The room in the page: floor, people, cameras with small pictures, hull, other likely poses."""

import time
from collections.abc import Sequence

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import HUMAN, LANDMARK_BONES
from silhouette_core.body.model import BodyModel
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion.kinematics import quaternions
from voxelpose.live.live_frame import LiveFrame, People, PosedBody
from voxelpose.view.images.canvas import Colour
from voxelpose.view.serving.page_server import move_bones
from voxelpose.view.viewer.legend import HULL, HYPOTHESIS, SILHOUETTE, faded, person_colour
from voxelpose.view.viewer.viser_camera import add_camera

_PICTURE_PX = 320
_REBUILD_S = 1  # an estimation that adapts the body may give a new one with every frame
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


class CameraViews:
    """Draws the cameras. Of each frame one camera's picture is sent, in turn: they cost most."""

    def __init__(self, scene: viser.SceneApi, rig: Sequence[Camera]) -> None:
        self._cameras = tuple(rig)
        self._views = [UndistortedView.from_camera(camera, _PICTURE_PX) for camera in rig]
        look = {"scale": 0.4, "thickness": 0.008, "color": (60, 66, 74), "receive_shadow": False}
        drawn = (
            add_camera(scene, camera, format="jpeg", jpeg_quality=70, **look) for camera in rig
        )
        self._handles, self._labels = zip(*drawn, strict=True)
        self._next = 0

    def show(self, visible: bool) -> None:
        """Shows or hides the cameras."""
        for handle in (*self._handles, *self._labels):
            handle.visible = visible

    def draw(self, frame: LiveFrame, outlines: bool) -> None:
        """Shows the next camera's picture, with outlines of silhouettes or without."""
        for _ in self._cameras:
            k, self._next = self._next, (self._next + 1) % len(self._cameras)
            picture = frame.pictures.get(self._cameras[k].name)
            if picture is not None:
                silhouette = frame.silhouettes.get(self._cameras[k].name) if outlines else None
                self._handles[k].image = small_picture(picture, silhouette, self._views[k])
                return

    def clear(self) -> None:
        """Removes the pictures."""
        for handle in self._handles:
            handle.image = None


def small_picture(
    picture: NDArray[np.uint8], silhouette: NDArray[np.bool_] | None, view: UndistortedView
) -> NDArray[np.uint8]:
    """Small picture (h, w, 3) uint8 RGB, as the view shows it, of one as captured, (H, W, 3) uint8
    BGR, with the outline of its silhouette, (h, w) bool, perhaps scaled down, if there is one.
    """
    size = view.pinhole.size
    # Bilinear: means over all pixels of a large picture would cost ten times as much.
    small = cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR)
    small = cv2.cvtColor(small, cv2.COLOR_BGR2RGB)
    if silhouette is not None and silhouette.any():
        mask = cv2.resize(silhouette.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(small, outlines, -1, SILHOUETTE, 2, cv2.LINE_AA)
    if view.maps is not None:
        small = cv2.remap(small, *view.maps, cv2.INTER_LINEAR)
    return np.asarray(small, np.uint8)


def _bone_parts() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Parts (18,) that are bones of the mesh, and for each part (27,) the bone that moves it.

    Parts whose joints the estimation leaves at rest move with their parents: every bone costs.
    """
    movable = np.zeros(len(HUMAN.names), bool)
    movable[HUMAN.dof_part[~HUMAN.dof_fixed]] = True
    bones: list[int] = []
    bone_of = np.zeros(len(movable), np.int64)
    for part, parent in enumerate(HUMAN.parents):
        if parent < 0 or movable[part]:
            bone_of[part] = len(bones)
            bones.append(part)
        else:
            bone_of[part] = bone_of[parent]
    return np.array(bones), bone_of


_BONES, _BONE_OF = _bone_parts()


class SkinnedFigure:
    """Draws the body: browsers get its mesh once, then only the bones' places and rotations."""

    def __init__(self, scene: viser.SceneApi, name: str, colour: Colour) -> None:
        self._scene, self._name, self._colour = scene, name, colour
        self._handle: viser.MeshSkinnedHandle | None = None
        self._model: BodyModel | None = None
        self._built_s = -np.inf
        self._places = np.zeros((len(_BONES), 7))

    def draw(self, body: PosedBody | None) -> None:
        """Shows a body; None: hides it."""
        if body is not None and self._is_other(body.model):
            self._build(body.model)
        if self._handle is None:
            return
        self._handle.visible = body is not None
        if body is None:
            return
        places = np.hstack([quaternions(body.part_rotation[_BONES]), body.part_origin_m[_BONES]])
        still = 2e-4  # metres and components of quaternions: what nobody sees is not sent
        moved = np.flatnonzero(np.abs(places - self._places).max(1) > still)
        move_bones(self._handle, moved, places[moved])
        self._places[moved] = places[moved]

    def _is_other(self, model: BodyModel) -> bool:
        current = self._model
        if current is None:
            return True
        if model is current or time.monotonic() - self._built_s < _REBUILD_S:
            return False
        same = model.sizes == current.sizes and np.array_equal(model.shape, current.shape)
        if same:
            self._model = model
        return not same

    def _build(self, model: BodyModel) -> None:
        if self._handle is not None:
            self._handle.remove()
        weights = np.zeros((len(model.vertices_m), len(_BONES)), np.float32)
        rows = np.arange(len(weights))[:, None]
        np.add.at(weights, (rows, _BONE_OF[model.skin_parts]), model.skin_weights)
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(_BONES), 1))
        self._places = np.hstack([turns, model.joints_m[_BONES]])
        self._handle = self._scene.add_mesh_skinned(
            self._name,
            model.vertices_m.astype(np.float32),
            model.faces.astype(np.uint32),
            bone_wxyzs=turns,
            bone_positions=model.joints_m[_BONES],
            skin_weights=weights,
            color=self._colour,
        )
        self._model, self._built_s = model, time.monotonic()


_ALONE: Colour = (84, 146, 214)
_NO_POINTS = np.zeros((0, 3), np.float32)


class LiveScene:
    """The nodes of viser's scene; of several people each has a colour of its own."""

    def __init__(self, server: viser.ViserServer, rig: Sequence[Camera], people: int = 1) -> None:
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
        self._figures = [SkinnedFigure(scene, "/figure", _ALONE)]
        if people > 1:
            self._figures = [
                SkinnedFigure(scene, f"/figure_{k + 1}", person_colour(k)) for k in range(people)
            ]
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

    def draw(self, frame: LiveFrame, layers: frozenset[str]) -> None:
        """Shows the chosen `LAYERS` of one moment."""
        pictures = {"cameras", "pictures"} <= layers
        if layers != self._drawn:
            self._cameras.show("cameras" in layers)
            if not pictures:
                self._cameras.clear()
            self._drawn = layers
        for figure, body in zip(self._figures, frame.people, strict=True):
            figure.draw(body if "figure" in layers else None)
        self._draw_hypotheses(frame.body if "hypotheses" in layers else None)
        self._count += 1
        if self._count % 2:  # hull and pictures cost the most, and may lag a little
            self._draw_hull(frame.people if "hull" in layers else ())
        elif pictures:
            self._cameras.draw(frame, "outlines" in layers)

    def _draw_hull(self, people: People) -> None:
        hulls = [body.hull_m for body in people if body is not None and body.hull_m is not None]
        points = np.concatenate([_NO_POINTS, *hulls])
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
