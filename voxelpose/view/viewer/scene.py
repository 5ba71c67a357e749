"""Contents of one frame of a result, and its cameras' pictures."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.estimator import BackgroundKind
from silhouette_core.image.seen_people import SeenPeople
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView, scaled_unknown
from voxelpose.export.tables import Hypothesis
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX, unknown_views
from voxelpose.people_marks import display_name
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import Frame, read_together
from voxelpose.tuning import REPORT
from voxelpose.view.images.canvas import Colour, hatched, reduced
from voxelpose.view.viewer.outer_voxels import NearestBodies, OuterVoxels

Pictures = Literal["both", "picture", "silhouette"]
SILHOUETTE: Colour = (255, 150, 40)
"""RGB."""
OUTLYING_CM = 5
"""Distance from the body above which a voxel is unexplained: a hull of few cameras is too large."""
_FAR = f"more than {OUTLYING_CM} cm from the body"
PICTURE_PX = 480
"""Longest side of the cameras' pictures in the scene."""
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
    nearest: NearestBodies  # bodies next to the voxels
    outer: OuterVoxels  # those at the surface

    @property
    def far(self) -> NDArray[np.bool_]:
        """Voxels (nx, ny, nz) that lie outside of every body's surroundings."""
        return self.occupancy & (self.nearest.distance_m > OUTLYING_CM / 100)

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
    names: tuple[str, ...]  # of everybody
    # Other poses that one camera leaves open, the likeliest first.
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[str, ...]  # what is missing, in words


def frame_lines(scene: Scene) -> list[tuple[int | None, str]]:
    """Description of a frame, in lines, each with the number of the one of several people whom it
    is about, or None; what is missing is in its notes.
    """
    hull, several = scene.hull, len(scene.bodies) > 1
    lines = list[tuple[int | None, str]]()
    for k, (name, body) in enumerate(zip(scene.names, scene.bodies, strict=True)):
        words = [*_body_words(body)]
        if body is not None and hull is not None:
            near = hull.nearest.person == k
            words.append(f"Hull {hull.litres(near):.0f} litres.")
            words.append(f"{hull.litres(near & hull.far):.0f} litres of it are {_FAR}.")
        whose = f"{name[:1].upper()}{display_name(name[1:])}: " if several else ""
        lines += [(k if several else None, whose + each) for each in words]
    if hull is not None and not any(scene.bodies):
        lines.append((None, f"Hull {hull.litres(hull.occupancy):.0f} litres."))
    lines += [
        (None, f"Pose {hypothesis.rank}: {100 * hypothesis.probability:.0f} %")
        for hypothesis in scene.hypotheses
    ]
    return lines


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
        display_name(name)
        for name, overlap in zip(body.part_names, body.overlap, strict=True)
        if overlap < REPORT.covered
    ]
    if weak:
        yield f"Little inside the hull: {', '.join(weak)}."


def camera_picture(
    camera_frame: CameraFrame, pictures: Pictures, most_px: int = PICTURE_PX
) -> NDArray[np.uint8] | None:
    """Picture (h, w, 3) uint8 RGB whose sides have at most so many pixels; None where there is
    nothing to show.
    """
    picture, mask = camera_frame.picture, camera_frame.mask
    if mask is not None and (picture is None or pictures == "silhouette"):
        picture = np.where(mask[..., None], 255, 30).astype(np.uint8).repeat(3, axis=2)
    elif picture is not None and mask is not None and pictures == "both":
        person = (0.55 * picture + 0.45 * np.array(SILHOUETTE)).astype(np.uint8)
        picture = np.where(mask[..., None], person, picture // 2)
    if picture is None:
        return None
    if camera_frame.unknown is not None:
        picture = hatched(picture, camera_frame.unknown)
    return reduced(picture, most_px / max(picture.shape[:2]))


class CameraFrames:
    """Reads frames in any order: one shortly after the last by reading on, since videos are decoded
    from their start.
    """

    def __init__(
        self,
        recording: Recording,
        kind: BackgroundKind,
        views: Mapping[str, UndistortedView],
        network: Path | None = None,
    ) -> None:
        """Prepares; nothing is read before the first frame. Views are those of every camera; the
        pose network is that which the fit asked.
        """
        self._recording = recording
        self._kind: BackgroundKind = kind
        self._views, self._network = views, network
        self._next, self._frames = 0, None
        self._pictures: dict[str, Frame] = {}

    @cached_property
    def silhouettes(self) -> Silhouettes:
        """The background models; learned when first asked for."""
        people = self._network and SeenPeople(self._recording.rig.names, self._network)
        return Silhouettes(self._recording, self._kind, LONG_SIDE_PX, people=people)

    @cached_property
    def unknown(self) -> tuple[NDArray[np.bool_], ...] | None:
        """Where nothing is known, (h, w) bool in every view; None: nowhere."""
        unknown = scaled_unknown(self._recording, LONG_SIDE_PX)
        return unknown_views(unknown, list(self._views.values()))

    def read(self, frame: int) -> tuple[CameraFrame, ...]:
        """Undistorted pictures and silhouettes of a frame, one per camera."""
        pictures = self._read(frame)
        masks = self.silhouettes.of(pictures, step=self._next - 1)
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
            self._next = max(step, 0)
            self._frames = read_together(recording.readers, recording.first + self._next, stop)
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
