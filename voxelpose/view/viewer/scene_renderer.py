"""Draws scenes on viser's stage: cameras, voxels, body, skeletons, areas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_BONES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import quaternions
from voxelpose.export.hypotheses import Hypothesis
from voxelpose.view.images.canvas import colour_of
from voxelpose.view.images.figure import skeleton_bones
from voxelpose.view.viewer.legend import (
    AREA,
    DISPUTED,
    GUESS,
    HULL,
    OFF_M,
    PAPER,
    SILHOUETTE,
    UNEXPLAINED,
    Colour,
    overlap_colours,
)
from voxelpose.view.viewer.result_scenes import Area, BodyState, CameraFrame, Scene

Pictures = Literal["both", "picture", "silhouette"]
PICTURES: tuple[Pictures, ...] = ("both", "picture", "silhouette")
_PICTURE_PX = 480  # of a camera's picture on its way to the browser
_NOTHING = np.zeros((0, 3))


@dataclass(frozen=True)
class Choice:
    """What the user wants to see.

    Attributes:
        row: of `ResultScenes.frames`.
        pictures: what the cameras show.
        cameras, hull, unexplained, body, skeleton, hypotheses: whether each is shown.
        part: name of the limb whose movable area is shown; None: none.
    """

    row: int = 0
    pictures: Pictures = "both"
    cameras: bool = True
    hull: bool = True
    unexplained: bool = True
    body: bool = True
    skeleton: bool = True
    hypotheses: bool = True
    part: str | None = None


class SceneRenderer:
    """The nodes of one viser scene. Nothing is computed here that a picture would not need."""

    def __init__(self, api: viser.SceneApi, voxel_size_m: float, model: BodyModel | None) -> None:
        """Prepares.

        Args:
            api: viser's scene.
            voxel_size_m: size of the points that stand for voxels.
            model: the body; None where there is none.
        """
        self._api = api
        self._voxel_size_m = voxel_size_m
        self._frusta: dict[str, viser.CameraFrustumHandle] = {}
        self._skin = (
            [] if model is None else [_piece(model, part) for part in range(len(model.names))]
        )
        self._names = () if model is None else model.names
        self._meshes: list[viser.MeshHandle] = []
        self._hypotheses = 0

    def draw(self, scene: Scene, areas: dict[str, Area], choice: Choice) -> None:
        """Shows a scene, and of it what is chosen."""
        for camera_frame in scene.camera_frames:
            self._camera(camera_frame, choice)
        self._hull(scene, choice)
        self._body(scene.body, choice)
        self._skeleton(scene.body if choice.skeleton else None)
        self._other_poses(scene.hypotheses if choice.hypotheses else ())
        area = areas.get(choice.part or "")
        size = self._voxel_size_m
        self._points("area", _NOTHING if area is None else area.points_m, AREA, 0.7 * size)
        self._points("disputed", _NOTHING if area is None else area.disputed_m, DISPUTED, size)

    def _camera(self, camera_frame: CameraFrame, choice: Choice) -> None:
        camera = camera_frame.camera
        handle = self._frusta.get(camera.name)
        if handle is None:
            width, height = camera.size
            handle = self._api.add_camera_frustum(
                f"/cameras/{camera.name}",
                fov=2 * float(np.arctan(height / (2 * camera.matrix[1, 1]))),
                aspect=width / height,
                scale=0.35,
                thickness=0.006,
                cast_shadow=False,
                wxyz=quaternions(camera.rotation.T[None])[0],
                position=camera.center_m,
            )
            self._api.add_label(f"/cameras/{camera.name}/name", camera.name)
            self._frusta[camera.name] = handle
        handle.visible = choice.cameras
        picture = camera_picture(camera_frame, choice.pictures) if choice.cameras else None
        if picture is not None:
            handle.image = picture

    def _hull(self, scene: Scene, choice: Choice) -> None:
        hull = scene.hull
        # Dots where there is a body inside: a surface, even one seen through, would hide parts of
        # it.
        dots = (
            hull.vertices_m
            if hull is not None and choice.hull and scene.body is not None
            else _NOTHING
        )
        self._points("hull/dots", dots, HULL, 0.003)
        if hull is not None and choice.hull and scene.body is None:
            self._api.add_mesh_simple("/hull/surface", hull.vertices_m, hull.faces, color=HULL)
        else:
            self._api.remove_by_name("/hull/surface")
        points = (
            hull.unexplained_m[hull.off_m > OFF_M]
            if hull is not None and choice.unexplained
            else _NOTHING
        )
        self._points("unexplained", points, UNEXPLAINED, 0.3 * self._voxel_size_m)

    def _body(self, body: BodyState | None, choice: Choice) -> None:
        if body is None or not choice.body:
            for mesh in self._meshes:
                mesh.visible = False
            return
        if not self._meshes:
            for name, (inside, faces) in zip(self._names, self._skin, strict=True):
                self._meshes.append(
                    self._api.add_mesh_simple(f"/body/{name}", body.vertices_m[inside], faces)
                )
        for mesh, (inside, _), colour in zip(
            self._meshes, self._skin, overlap_colours(body.overlap), strict=True
        ):
            mesh.vertices = body.vertices_m[inside].astype(np.float32)
            mesh.color = tuple(colour.tolist())
            mesh.opacity = 0.7 if choice.skeleton else None
            mesh.visible = True

    def _skeleton(self, body: BodyState | None) -> None:
        if body is None:
            self._api.remove_by_name("/skeleton")
            return
        bones = skeleton_bones()
        ends = body.joints_m[np.array([bone[:2] for bone in bones])]
        colours = np.array(
            [
                colour_of(name)[::-1]
                for name in [self._names[min(end, len(self._names) - 1)] for _, end, _ in bones]
            ]
        )
        self._api.add_line_segments(
            "/skeleton", ends, np.repeat(colours[:, None], 2, 1).astype(np.uint8), thickness=0.015
        )

    def _other_poses(self, hypotheses: tuple[Hypothesis, ...]) -> None:
        likeliest = max((hypothesis.probability for hypothesis in hypotheses), default=1.0)
        for k, hypothesis in enumerate(hypotheses):
            ends = hypothesis.joints_m[LANDMARK_BONES]
            ends = ends[np.isfinite(ends).all((1, 2))]
            # Lines know no opacity: the less likely fade into the background instead.
            share = 0.15 + 0.85 * hypothesis.probability / max(likeliest, 1e-9)
            colour = np.round(share * np.array(GUESS) + (1 - share) * np.array(PAPER)).astype(
                np.uint8
            )
            self._api.add_line_segments(f"/guess_{k}", ends, colour, thickness=0.006)
        for k in range(len(hypotheses), self._hypotheses):
            self._api.remove_by_name(f"/guess_{k}")
        self._hypotheses = len(hypotheses)

    def _points(self, name: str, points: NDArray[np.float64], colour: Colour, size: float) -> None:
        if len(points):
            self._api.add_point_cloud(
                f"/{name}",
                points,
                colour,
                point_size=size,
                precision="float32",
                point_shape="rounded",
            )
        else:
            self._api.remove_by_name(f"/{name}")


def camera_picture(camera_frame: CameraFrame, pictures: Pictures) -> NDArray[np.uint8] | None:
    """Returns what a camera shows, (h, w, 3) uint8 RGB of at most 480 px; None where there is
    nothing to show.
    """
    picture, mask = camera_frame.picture, camera_frame.mask
    if mask is not None and (picture is None or pictures == "silhouette"):
        picture = np.where(mask[..., None], 255, 30).astype(np.uint8).repeat(3, axis=2)
    elif picture is not None and mask is not None and pictures == "both":
        picture = np.where(
            mask[..., None],
            (0.55 * picture + 0.45 * np.array(SILHOUETTE)).astype(np.uint8),
            picture // 2,
        )
    if picture is None:
        return None
    scale = min(1.0, _PICTURE_PX / max(picture.shape[:2]))
    size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _piece(model: BodyModel, part: int) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Returns the vertices of one part's triangles, and the triangles among those."""
    inside, faces = np.unique(model.faces[model.face_part == part], return_inverse=True)
    return inside, faces.reshape(-1, 3).astype(np.uint32)
