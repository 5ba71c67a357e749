"""Contents of one frame of a result, its cameras' pictures, and their drawing with viser."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from calib.camera import Camera
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import BackgroundKind
from silhouette_core.image.segmenter import load_segmenter
from silhouette_core.image.silhouettes import BodyOdds, Silhouettes, UndistortedView, scaled_unknown
from silhouette_core.motion.kinematics import quaternions
from voxelpose.export.tables import Hypothesis
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.matcher import LimbArea
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX, unknown_views
from voxelpose.people_marks import person_names
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import Frame, read_together
from voxelpose.tuning import REPORT
from voxelpose.view.images.canvas import Colour, hatched, reduced
from voxelpose.view.images.figure import bone_ends
from voxelpose.view.viewer import legend

Pictures = Literal["both", "picture", "silhouette"]
PICTURES: tuple[Pictures, ...] = ("both", "picture", "silhouette")
LAYERS = {
    "cameras": "Cameras",
    "hull": "Voxels",
    "unexplained": "Unexplained voxels",
    "body": "Body",
    "skeleton": "Skeleton",
    "hypotheses": "Other likely poses",
}
"""What can be shown, and how the page calls it; unexplained are voxels that no part explains."""
_PICTURE_PX = 480  # longest side of a picture sent to the browser
_MOST_SKIPPED = 40  # frames that are rather decoded and discarded than reached from the start


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """Picture and silhouette of one camera."""

    camera: Camera  # without distortion, of the picture's size
    # (h, w, 3) uint8 RGB, undistorted; None where the recording is missing or holds silhouettes
    # only.
    picture: NDArray[np.uint8] | None = None
    # (h, w) bool, the silhouette; None where the recording is missing.
    mask: NDArray[np.bool_] | None = None
    unknown: NDArray[np.bool_] | None = None  # (h, w) bool, where nothing is known; None: nowhere


@dataclass(frozen=True, eq=False)
class CarvedHull:
    """Hull of the body."""

    grid: VoxelGrid
    occupancy: NDArray[np.bool_]  # (nx, ny, nz) bool
    vertices_m: NDArray[np.float64]  # (V, 3) float64, vertices of its surface in the world
    faces: NDArray[np.int64]  # (F, 3) int64, triangles of its surface
    # (n, 3) float64, centres of the voxels that no part of the fitted body covers.
    unexplained_m: NDArray[np.float64]
    # (n,) float64, distance of each of those from the inside of the body.
    distance_m: NDArray[np.float64]

    def litres(self, voxels: NDArray[np.bool_]) -> float:
        """Volume of the true ones of some voxels, litres."""
        return 1000 * float(np.count_nonzero(voxels)) * self.grid.voxel_size_m**3


@dataclass(frozen=True, eq=False)
class BodyState:
    """The fitted body."""

    vertices_m: NDArray[np.float64]  # (V, 3) float64, its skin in the world
    joints_m: NDArray[np.float64]  # (J, 3) float64, the ends of the bones
    bones: list[tuple[int, int, Colour]]  # lines of the skeleton, see `skeleton_bones`
    part_names: tuple[str, ...]  # P names
    # (P,) float64, fraction of each part inside the hull; NaN where unknown.
    overlap: NDArray[np.float64]
    outline_agreement: float | None  # of the frame, from 0 to 1; None where the estimator gave none


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that one frame shows."""

    frame: int
    time_s: float  # its time, seconds
    camera_frames: tuple[CameraFrame, ...]
    hull: CarvedHull | None  # None without silhouettes of two cameras
    # Of everybody that was fitted; None where no pose was found.
    bodies: tuple[BodyState | None, ...]
    # Other poses that one camera leaves open, the likeliest first.
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[str, ...]  # what is missing, in words

    @property
    def is_posed(self) -> bool:
        """Whether somebody has a pose."""
        return any(body is not None for body in self.bodies)


_NOTHING = np.zeros((0, 3))


def frame_html(scene: Scene) -> str:
    """Description of a frame, as HTML; texts from files are escaped."""
    lines = [f"Frame {scene.frame}, {scene.time_s:.2f} s"]
    names = person_names(len(scene.bodies)) if len(scene.bodies) > 1 else [""]
    for name, body in zip(names, scene.bodies, strict=False):
        whose = f"{legend.display_name(name).capitalize()}: " if name else ""
        lines += [whose + words for words in _body_words(body)]
    if scene.hull is not None:
        lines.append(f"Hull {scene.hull.litres(scene.hull.occupancy):.0f} litres.")
        if scene.is_posed:
            far = scene.hull.litres(scene.hull.distance_m > legend.OUTLYING_CM / 100)
            lines.append(f"{far:.0f} litres of it are {legend.FAR}.")
    lines += [f"⚠ {note}" for note in scene.notes]
    lines += [
        f"Pose {hypothesis.rank}: {100 * hypothesis.probability:.0f} %"
        for hypothesis in scene.hypotheses
    ]
    return legend.text_html(lines)


def _body_words(body: BodyState | None) -> Iterator[str]:
    """How well a body agrees with what was seen."""
    if body is None:
        return
    agreement = body.outline_agreement
    if agreement is not None and np.isfinite(agreement):
        yield (
            f"Outline agreement {100 * agreement:.0f} %: how well the body's outline covers the"
            " silhouettes."
        )
    weak = [
        legend.display_name(name)
        for name, overlap in zip(body.part_names, body.overlap, strict=True)
        if overlap < REPORT.covered
    ]
    if weak:
        yield f"Little inside the hull: {', '.join(weak)}."


@dataclass(frozen=True)
class Choice:
    """Selection of what is shown."""

    row: int = 0  # of `ResultScenes.frames`
    pictures: Pictures = "both"
    shown: frozenset[str] = frozenset(LAYERS)  # names of `LAYERS`, and of several people
    part: str | None = None  # name of the limb whose movable area is shown; None: none


class SceneRenderer:
    """The nodes of one viser scene."""

    def __init__(
        self, api: viser.SceneApi, voxel_size_m: float, models: Sequence[BodyModel]
    ) -> None:
        self._api = api
        self._voxel_size_m = voxel_size_m
        self._frusta: dict[str, viser.CameraFrustumHandle] = {}
        names = person_names(len(models)) if len(models) > 1 else [""]
        self._bodies = [
            _DrawnBody(api, model, name, legend.person_colour(k) if name else None)
            for k, (name, model) in enumerate(zip(names, models, strict=False))
        ]
        self._hypotheses = 0

    def draw(self, scene: Scene, areas: dict[str, LimbArea], choice: Choice) -> None:
        """Shows what is chosen of a scene."""
        for camera_frame in scene.camera_frames:
            self._camera(camera_frame, choice)
        self._hull(scene, choice.shown)
        for drawn, body in zip(self._bodies, scene.bodies, strict=True):
            drawn.draw(body, choice.shown)
        self._other_poses(scene.hypotheses if "hypotheses" in choice.shown else ())
        area, size = areas.get(choice.part or ""), self._voxel_size_m
        reach = disputed = _NOTHING
        if area is not None and scene.hull is not None:
            reach, disputed = map(scene.hull.grid.centres, (area.voxels, area.disputed))
        self._points("area", reach, legend.AREA, 0.7 * size)
        self._points("disputed", disputed, legend.DISPUTED, size)

    def _camera(self, camera_frame: CameraFrame, choice: Choice) -> None:
        camera = camera_frame.camera
        handle = self._frusta.get(camera.name)
        if handle is None:
            handle, _ = add_camera(self._api, camera, scale=0.35, thickness=0.006)
            self._frusta[camera.name] = handle
        handle.visible = "cameras" in choice.shown
        picture = camera_picture(camera_frame, choice.pictures) if handle.visible else None
        if picture is not None:
            handle.image = picture

    def _hull(self, scene: Scene, shown: frozenset[str]) -> None:
        hull, dots, outlying = scene.hull, _NOTHING, _NOTHING
        if hull is not None and "hull" in shown and not scene.is_posed:
            self._api.add_mesh_simple(
                "/hull/surface", hull.vertices_m, hull.faces, color=legend.HULL
            )
        else:
            self._api.remove_by_name("/hull/surface")
        # Dots where there is a body inside: a surface, even a transparent one, would hide it.
        if hull is not None and "hull" in shown and scene.is_posed:
            dots = hull.vertices_m
        if hull is not None and "unexplained" in shown:
            outlying = hull.unexplained_m[hull.distance_m > legend.OUTLYING_CM / 100]
        self._points("hull/dots", dots, legend.HULL, 0.003)
        self._points("unexplained", outlying, legend.UNEXPLAINED, 0.3 * self._voxel_size_m)

    def _other_poses(self, hypotheses: tuple[Hypothesis, ...]) -> None:
        likeliest = max((hypothesis.probability for hypothesis in hypotheses), default=1.0)
        for k, hypothesis in enumerate(hypotheses):
            ends = hypothesis.joints_m[hypothesis.bones]
            ends = ends[np.isfinite(ends).all((1, 2))]
            colour = legend.faded(hypothesis.probability / max(likeliest, 1e-9))
            self._api.add_line_segments(f"/hypothesis_{k}", ends, colour, thickness=0.006)
        for k in range(len(hypotheses), self._hypotheses):
            self._api.remove_by_name(f"/hypothesis_{k}")
        self._hypotheses = len(hypotheses)

    def _points(self, name: str, points: NDArray[np.float64], colour: Colour, size: float) -> None:
        if len(points):
            look: dict[str, Any] = {"precision": "float32", "point_shape": "rounded"}
            self._api.add_point_cloud(f"/{name}", points, colour, point_size=size, **look)
        else:
            self._api.remove_by_name(f"/{name}")


class _DrawnBody:
    """The nodes of one body."""

    def __init__(
        self, api: viser.SceneApi, model: BodyModel, name: str, colour: Colour | None
    ) -> None:
        """Prepares; of several people a body has a name and a colour, RGB, of its own. Without,
        parts are coloured by their share inside the hull.
        """
        self._api, self._model, self._name, self._colour = api, model, name, colour
        self._place = f"/{name}" if name else ""
        self._skin = [_part_mesh(model, part) for part in range(len(model.names))]
        self._meshes: list[viser.MeshHandle] = []

    def draw(self, body: BodyState | None, shown: frozenset[str]) -> None:
        """Shows what is chosen of a body; None: no pose was found."""
        if self._name and self._name not in shown:
            body = None
        self._body(body if "body" in shown else None, "skeleton" in shown)
        self._skeleton(body if "skeleton" in shown else None)

    def _body(self, body: BodyState | None, is_thin: bool) -> None:
        if body is None:
            for mesh in self._meshes:
                mesh.visible = False
            return
        if not self._meshes:
            for name, (inside, faces) in zip(self._model.names, self._skin, strict=True):
                at = f"/body{self._place}/{name}"
                self._meshes.append(self._api.add_mesh_simple(at, body.vertices_m[inside], faces))
        colours = legend.overlap_colours(body.overlap)
        if self._colour is not None:
            colours[:] = self._colour
        for mesh, (inside, _), colour in zip(self._meshes, self._skin, colours, strict=True):
            mesh.vertices = body.vertices_m[inside].astype(np.float32)
            mesh.color = tuple(colour.tolist())
            mesh.opacity = 0.7 if is_thin else None
            mesh.visible = True

    def _skeleton(self, body: BodyState | None) -> None:
        at = f"/skeleton{self._place}"
        if body is None or not body.bones:
            self._api.remove_by_name(at)
            return
        ends = body.joints_m[bone_ends(body.bones)]
        colours = np.array([[colour[::-1]] * 2 for _, _, colour in body.bones], np.uint8)
        self._api.add_line_segments(at, ends, colours, thickness=0.015)


def add_camera(
    scene: viser.SceneApi, camera: Camera, **look: Any
) -> tuple[viser.CameraFrustumHandle, viser.LabelHandle]:
    """Draws a camera where it stands, with its name."""
    width, height = camera.size
    frustum = scene.add_camera_frustum(
        f"/cameras/{camera.name}",
        fov=2 * float(np.arctan(height / (2 * camera.matrix[1, 1]))),
        aspect=width / height,
        cast_shadow=False,
        wxyz=quaternions(camera.rotation.T[None])[0],
        position=camera.center_m,
        **look,
    )
    return frustum, scene.add_label(f"/cameras/{camera.name}/name", camera.name)


def camera_picture(camera_frame: CameraFrame, pictures: Pictures) -> NDArray[np.uint8] | None:
    """Picture (h, w, 3) uint8 RGB of at most 480 px; None where there is nothing to show."""
    picture, mask = camera_frame.picture, camera_frame.mask
    if mask is not None and (picture is None or pictures == "silhouette"):
        picture = np.where(mask[..., None], 255, 30).astype(np.uint8).repeat(3, axis=2)
    elif picture is not None and mask is not None and pictures == "both":
        person = (0.55 * picture + 0.45 * np.array(legend.SILHOUETTE)).astype(np.uint8)
        picture = np.where(mask[..., None], person, picture // 2)
    if picture is None:
        return None
    if camera_frame.unknown is not None:
        picture = hatched(picture, camera_frame.unknown)
    return reduced(picture, _PICTURE_PX / max(picture.shape[:2]))


def _part_mesh(model: BodyModel, part: int) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Vertex numbers of one part's triangles, and the triangles as indices into those."""
    inside, faces = np.unique(model.faces[model.face_part == part], return_inverse=True)
    return inside, faces.reshape(-1, 3).astype(np.uint32)


class CameraFrames:
    """Reads frames in any order: one shortly after the last by reading on, since videos are decoded
    from their start.
    """

    def __init__(
        self,
        recording: Recording,
        kind: BackgroundKind,
        views: Mapping[str, UndistortedView],
        segmenter: str | None = None,
    ) -> None:
        """Prepares; nothing is read before the first frame. A segmenter told where people are, and
        is left out where it cannot be used any more; views are those of every camera by name.
        """
        self._recording = recording
        self._kind: BackgroundKind = kind
        self._views, self._segmenter = views, segmenter
        self._next, self._frames = 0, None
        self._pictures: dict[str, Frame] = {}

    @cached_property
    def silhouettes(self) -> Silhouettes:
        """The background models; learned when first asked for."""
        return self.silhouettes_with(None)

    def silhouettes_with(self, bodies: BodyOdds | None) -> Silhouettes:
        """Background models learned anew, with what is known of bodies, see `Silhouettes`."""
        segmenter = self._segmenter
        try:
            if segmenter is not None:
                load_segmenter(segmenter)
        except InputError:
            segmenter = None
        known = {"segmenter": segmenter, "bodies": bodies}
        return Silhouettes(self._recording, self._kind, LONG_SIDE_PX, **known)

    @cached_property
    def unknown(self) -> tuple[NDArray[np.bool_], ...] | None:
        """Where nothing is known, (h, w) bool in every view; None: nowhere."""
        found = scaled_unknown(self._recording, LONG_SIDE_PX)
        return unknown_views(found, list(self._views.values()))

    def read(self, frame: int) -> tuple[CameraFrame, ...]:
        """Undistorted pictures and silhouettes of a frame, one per camera."""
        pictures = self._read(frame)
        masks = self.silhouettes.of(pictures)
        given, unknown = self._recording.silhouettes_given, self.unknown or [None] * len(masks)
        return tuple(
            CameraFrame(
                view.pinhole,
                None if given else _undistorted(pictures[name], view),
                view.undistort(masks[name]),
                hidden,
            )
            for (name, view), hidden in zip(self._views.items(), unknown, strict=True)
        )

    def _read(self, frame: int) -> dict[str, Frame]:
        recording = self._recording
        step = int(np.searchsorted(recording.numbers, frame, side="right")) - 1
        if step == self._next - 1 and self._pictures:  # a lost frame shows the one before
            return self._pictures
        if self._frames is None or not 0 <= step - self._next <= _MOST_SKIPPED:
            self.close()
            stop = recording.first + recording.frame_count
            at = recording.first + max(step, 0), stop
            self._next, self._frames = max(step, 0), read_together(recording.readers, *at)
        while self._next <= step:
            self._pictures = next(self._frames)
            self._next += 1
        return self._pictures

    def close(self) -> None:
        """Stops reading."""
        if self._frames is not None:
            self._frames.close()  # type: ignore[attr-defined]
        self._frames = None


def _undistorted(picture: Frame, view: UndistortedView) -> NDArray[np.uint8]:
    """Picture (H, W, 3) BGR as the view's pinhole camera sees it, RGB."""
    image = picture
    if picture.shape[1::-1] != view.pinhole.size:
        image = cv2.resize(picture, view.pinhole.size, interpolation=cv2.INTER_AREA)
    if view.maps is not None:
        image = cv2.remap(image, *view.maps, cv2.INTER_LINEAR)
    return np.ascontiguousarray(image[..., ::-1], np.uint8)
