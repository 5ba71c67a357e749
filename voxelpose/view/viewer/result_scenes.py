"""A result and the recording it was made from, opened for looking: what there is to see at any
frame, made when asked for, and kept.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from calib.camera import Camera, Rig
from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.pose import Pose
from voxelpose.carving.bounds import place_grid
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.hull_mesh import surface
from voxelpose.export.hypotheses import HYPOTHESES, Hypothesis, read_hypotheses
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.matcher import movable_areas
from voxelpose.matching.observe import FrameObservation, HullObserver, body_rule
from voxelpose.matching.quality import assess
from voxelpose.multiview import LONG_SIDE_PX, VOXEL_M
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import Frame, read_together
from voxelpose.results import Result, is_result
from voxelpose.view.images.figure import skeleton_joints

_KEPT = 24  # frames whose scenes stay in memory
_USUAL_FPS = 25.0
_PATIENCE = 40  # frames that are rather read and thrown away than sought for anew
_REACH_M = 1.3  # of a body from its root: an arm's length above the head
_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """What one camera shows.

    Attributes: camera: without distortion, of the picture's size. picture: (h, w, 3) uint8 RGB,
        straightened; None where the recording is gone or holds silhouettes only. mask: (h, w) bool,
        the silhouette; None where the recording is gone.
    """

    camera: Camera
    picture: NDArray[np.uint8] | None = None
    mask: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Carved:
    """The hull.

    Attributes:
        grid: the voxels' places.
        occupancy: (nx, ny, nz) bool.
        vertices_m, faces: its surface, (V, 3) float64 world and (F, 3) int64.
        unexplained_m: (n, 3) float64, centres of the voxels that no part of the fitted body covers.
        off_m: (n,) float64, how far each of those is from the body's inside.
    """

    grid: VoxelGrid
    occupancy: NDArray[np.bool_]
    vertices_m: NDArray[np.float64]
    faces: NDArray[np.int64]
    unexplained_m: NDArray[np.float64]
    off_m: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyState:
    """The fitted body.

    Attributes:
        vertices_m: (V, 3) float64, its skin in the world.
        joints_m: (28, 3) float64, the ends of `skeleton_bones`.
        overlap: (27,) float64, share of each part inside the hull; NaN where unknown.
        confidence: of the frame, from 0 to 1; None where the estimator gave none.
        unexplained: share of the hull that no part covers, as the estimator gave it; None likewise.
    """

    vertices_m: NDArray[np.float64]
    joints_m: NDArray[np.float64]
    overlap: NDArray[np.float64]
    confidence: float | None
    unexplained: float | None


@dataclass(frozen=True, eq=False)
class Area:
    """Where a part could be, in paper B's sense.

    Attributes:
        points_m: (n, 3) float64, centres of the voxels of its movable area.
        disputed_m: (m, 3) float64, those that lie in another part's area of the same group, too.
        interferes: the parts that are matched together, itself among them.
    """

    points_m: NDArray[np.float64]
    disputed_m: NDArray[np.float64]
    interferes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """All that is to be seen at one frame.

    Attributes:
        frame: its number; time_s: its time, seconds.
        camera_frames: one per camera.
        hull: None without silhouettes of two cameras.
        body: None where no pose was found.
        hypotheses: other poses that one camera leaves open, the likeliest first.
        notes: what is missing, in words.
    """

    frame: int
    time_s: float
    camera_frames: tuple[CameraFrame, ...]
    hull: Carved | None
    body: BodyState | None
    hypotheses: tuple[Hypothesis, ...]
    notes: tuple[str, ...]


class ResultScenes:
    """Scenes of a result, or of a recording alone.

    Attributes:
        title: what is shown.
        rig: the cameras, as calibrated.
        frames: (T,) int64, the numbers of all frames; fps: of the recording.
        motion: the poses; None for a recording alone.
        recording: None where it is gone; `missing` then says why.
    """

    def __init__(
        self,
        folder: Path | str,
        recording: Path | None = None,
        voxel_size_m: float | None = None,
        unit: str | None = None,
    ):
        """Opens a folder.

        Args:
            folder: a result, or a recording.
            recording: where the result's recording lies now, if it has moved.
            voxel_size_m: of the hull; None: as in the fit.
            unit: of the recording's calibration, where it does not say.

        Raises:
            InputError: it is neither, or damaged.
        """
        folder = Path(folder)
        self.title = str(folder)
        self.result = Result.open(folder) if is_result(folder) else None
        self.recording: Recording | None = None
        self.missing = ""
        if self.result is None:
            self.recording = _open_recording(folder, None, None, unit, None)
            self.motion, self.rig, told, guessed = None, self.recording.rig, {}, {}
            self.frames, self.fps = np.arange(self.recording.frame_count), self.recording.fps
        else:
            self.motion, self.rig, self.fps = (
                self.result.motion,
                self.result.rig,
                self.result.motion.fps,
            )
            told, guessed = (
                self._reopen(self.result, recording, unit),
                read_hypotheses(folder / HYPOTHESES),
            )
        self._hypotheses: Mapping[int, tuple[Hypothesis, ...]] = guessed
        options: Any = told.get("options", {})
        self.voxel_size_m = float(voxel_size_m or options.get("voxel_size_m", VOXEL_M))
        self._rule = body_rule(len(self.rig), int(options.get("tolerance", 0)))
        self._lenses = {
            camera.name: UndistortedView.of(camera, LONG_SIDE_PX) for camera in self.rig
        }
        self._pictures = (
            _Pictures(self.recording, told.get("background", "refined"), self._lenses)
            if self.recording
            else None
        )
        self._parts = None if self.motion is None else self.motion.parts()
        self._solid = (
            None if self.motion is None else BodyVolume.of(self.motion.model, self.voxel_size_m)
        )
        self._made: _Kept[tuple[Scene, FrameObservation | None]] = _Kept()
        self._areas: _Kept[dict[str, Area]] = _Kept()

    def scene(self, frame: int) -> Scene:
        """Returns what is to be seen at a frame of `frames`.

        Raises:
            InputError: the recording cannot be read.
        """
        return self._made.get(frame, self._make)[0]

    def camera_frames(self, frame: int) -> tuple[CameraFrame, ...]:
        """Returns what the cameras show at a frame, without carving."""
        return (
            self._pictures.camera_frames(frame)
            if self._pictures
            else tuple(CameraFrame(lens.pinhole) for lens in self._lenses.values())
        )

    def body(self, frame: int) -> BodyState | None:
        """Returns the fitted body of a frame; None where it was not found."""
        row = self.row(frame)
        return (
            None
            if row is None or self.motion is None or self._parts is None
            else _posed(self.motion, self._parts, row)
        )

    def areas(self, frame: int) -> dict[str, Area]:
        """Returns the movable areas by the name of the limb's first part, none where there is no
        pose or no hull.

        Source: Iiyama, Kameda and Minoh, section 3; what is above a part is placed as it was
        fitted.
        """
        return self._areas.get(frame, self._find_areas)

    def row(self, frame: int) -> int | None:
        """Returns the row of the motion that holds a frame, or None."""
        found = [] if self.motion is None else np.flatnonzero(self.motion.frames == frame).tolist()
        return found[0] if found else None

    @property
    def has_hypotheses(self) -> bool:
        """Whether the result holds hypotheses of a monocular track."""
        return bool(self._hypotheses)

    def close(self) -> None:
        """Stops reading."""
        if self._pictures:
            self._pictures.close()

    def _reopen(
        self, result: Result, recording: Path | None, unit: str | None
    ) -> Mapping[str, Any]:
        told: Any = result.settings
        folder = recording or (result.folder / told.get("recording", "")).resolve()
        first, stop = told.get("frames") or (
            int(result.motion.frames[0]),
            int(result.motion.frames[-1]) + 1,
        )
        self.frames = np.arange(first, stop)
        if not folder.is_dir():
            self.missing = (
                f"the recording {folder} of this result is not there any more: say where with"
                " --recording"
            )
            return told
        try:
            found = _open_recording(
                folder, (first, stop), list(result.rig.names), unit, result.motion.fps
            )
            self.recording = replace(found, rig=result.rig)
        except InputError as error:
            self.missing = f"the recording cannot be read: {error}"
        return told

    def _make(self, frame: int) -> tuple[Scene, FrameObservation | None]:
        notes = [self.missing] if self.missing else []
        camera_frames, row, body = self.camera_frames(frame), self.row(frame), self.body(frame)
        if self.motion is not None and row is None:
            notes.append("no pose was found in this frame")
        observed = self._look(
            [camera_frame.mask for camera_frame in camera_frames if camera_frame.mask is not None],
            row,
            notes,
        )
        hull = None if observed is None else self._carved(observed, row)
        time_s = (
            float(self.motion.time_s[row])
            if self.motion is not None and row is not None
            else frame / self.fps
        )
        return (
            Scene(
                frame,
                time_s,
                camera_frames,
                hull,
                body,
                self._hypotheses.get(frame, ()),
                tuple(notes),
            ),
            observed,
        )

    def _look(
        self, masks: list[NDArray[np.bool_]], row: int | None, notes: list[str]
    ) -> FrameObservation | None:
        """Looks as the fit did: the same silhouettes, voxels and rule, in a volume around the
        motion.
        """
        observed = None
        if len(self.rig) < 2:
            notes.append("one camera leaves no voxels to carve")
        elif masks:
            views = PinholeViews.of(Rig(tuple(lens.pinhole for lens in self._lenses.values())))
            near = None if row is None or self.motion is None else self.motion.root_m[row]
            try:
                observed = HullObserver(
                    views, self._volume(views, masks), self.voxel_size_m, self._rule
                ).look(masks, near)
            except InputError as error:
                notes.append(str(error))
            else:
                if observed is None:
                    notes.append("the silhouettes leave no hull of a body's size")
        return observed

    def _volume(self, views: PinholeViews, masks: list[NDArray[np.bool_]]) -> VoxelGrid:
        if self.motion is None:
            return place_grid(views.rig, masks, 2 * self.voxel_size_m, rule=self._rule)
        root = self.motion.root_m
        return VoxelGrid.from_bounds(
            root.min(0) - _REACH_M, root.max(0) + _REACH_M, 2 * self.voxel_size_m
        )

    def _carved(self, observed: FrameObservation, row: int | None) -> Carved:
        vertices, faces = surface(*observed.grid.cropped(observed.occupancy))
        unexplained, off = np.zeros((0, 3)), np.zeros(0)
        if row is not None and self.motion is not None and self._solid is not None:
            unexplained = observed.grid.centres(
                assess(self._solid, _pose(self.motion, row), observed).unexplained_voxels
            )
            off = np.asarray(KDTree(self._filled(row)).query(unexplained)[0], float)
        return Carved(observed.grid, observed.occupancy, vertices, faces, unexplained, off)

    def _filled(self, row: int) -> NDArray[np.float64]:
        """Returns points (n, 3) all through the body."""
        if self._parts is None or self._solid is None:
            return np.zeros((0, 3))
        rotation, origin = (array[row] for array in self._parts)
        points = self._solid.part_points
        return np.concatenate(
            [points[p] @ rotation[p].T + origin[p] for p in range(len(points)) if len(points[p])]
        )

    def _find_areas(self, frame: int) -> dict[str, Area]:
        observed, row = self._made.get(frame, self._make)[1], self.row(frame)
        if observed is None or row is None or self.motion is None or self._solid is None:
            return {}
        grid = observed.grid
        found = movable_areas(self._solid, grid, observed.occupancy, _pose(self.motion, row))
        return {
            one.limb.name: Area(
                grid.centres(one.voxels), grid.centres(one.disputed), one.interferes
            )
            for one in found
        }


def _open_recording(
    folder: Path,
    frames: tuple[int, int] | None,
    cameras: list[str] | None,
    unit: str | None,
    fps: float | None,
) -> Recording:
    """Opens a recording at the rate that it tells; if that is none, or not what a fit was told, at
    the fit's, or at a usual one.

    A fit (whose rate is given) has its cameras in metres already: the unit of the recording's
        calibration does not matter there.
    """
    failed = None
    for said in (unit, "m") if unit is None and fps is not None else (unit,):
        for told in (None, fps or _USUAL_FPS):
            try:
                found = Recording.open(folder, frames, cameras, said, told)
            except InputError as error:
                failed = error if said == unit else failed
                continue
            if told is not None or fps is None or abs(found.fps - fps) < 0.01 * fps:
                return found
    raise failed or InputError(f"{folder} cannot be opened")


class _Kept(Generic[_T]):
    """What was made for the frames looked at last."""

    def __init__(self) -> None:
        self._found: OrderedDict[int, _T] = OrderedDict()

    def get(self, frame: int, make: Callable[[int], _T]) -> _T:
        if frame not in self._found:
            self._found[frame] = make(frame)
        self._found.move_to_end(frame)
        while len(self._found) > _KEPT:
            self._found.popitem(last=False)
        return self._found[frame]


class _Pictures:
    """Reads single frames; the next one, or one a little later, without starting anew: videos are
    decoded from their start.
    """

    def __init__(
        self,
        recording: Recording,
        method: Literal["paper", "refined"],
        lenses: Mapping[str, UndistortedView],
    ) -> None:
        self._recording = recording
        self._method: Literal["paper", "refined"] = method
        self._lenses = lenses
        self._next, self._frames = 0, None

    @cached_property
    def _silhouettes(self) -> Silhouettes:
        return Silhouettes(self._recording, self._method, LONG_SIDE_PX)

    def camera_frames(self, frame: int) -> tuple[CameraFrame, ...]:
        pictures = self._read(frame)
        masks = self._silhouettes.of(pictures)
        camera_frames = []
        for name, lens in self._lenses.items():
            picture = (
                None if self._recording.silhouettes_given else _undistorted(pictures[name], lens)
            )
            camera_frames.append(CameraFrame(lens.pinhole, picture, lens.undistort(masks[name])))
        return tuple(camera_frames)

    def _read(self, frame: int) -> dict[str, Frame]:
        if self._frames is None or not 0 <= frame - self._next <= _PATIENCE:
            self.close()
            stop = self._recording.first + self._recording.frame_count
            self._next, self._frames = frame, read_together(self._recording.readers, frame, stop)
        pictures: dict[str, Frame] = {}
        while self._next <= frame:
            pictures = next(self._frames)
            self._next += 1
        return pictures

    def close(self) -> None:
        if self._frames is not None:
            self._frames.close()  # type: ignore[attr-defined]
        self._frames = None


def _posed(
    motion: Motion, parts: tuple[NDArray[np.float64], NDArray[np.float64]], row: int
) -> BodyState:
    rotation, origin = (array[row] for array in parts)
    model, quality = motion.model, motion.quality
    overlap = quality.get("part_overlap")
    shares = (
        float(quality[name][row]) if name in quality else None
        for name in ("confidence", "unexplained")
    )
    return BodyState(
        kinematics.skin(model, rotation, origin),
        skeleton_joints(model, rotation, origin),
        np.full(len(model.names), np.nan) if overlap is None else np.asarray(overlap[row], float),
        *shares,
    )


def _pose(motion: Motion, row: int) -> Pose:
    return Pose(
        motion.root_m[row],
        kinematics.rotation_matrices(motion.root_quaternion[row]),
        motion.angles_rad[row],
    )


def _undistorted(picture: Frame, lens: UndistortedView) -> NDArray[np.uint8]:
    """Returns a picture (H, W, 3) BGR as the lens's pinhole sees it, RGB."""
    small = (
        picture
        if picture.shape[1::-1] == lens.pinhole.size
        else cv2.resize(picture, lens.pinhole.size, interpolation=cv2.INTER_AREA)
    )
    if lens.maps is not None:
        small = cv2.remap(small, *lens.maps, cv2.INTER_LINEAR)
    return np.ascontiguousarray(small[..., ::-1], np.uint8)
