"""Scenes of a result and the recording it was made from, made when asked for, and kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from calib.points import nearest_point
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion, posed_times
from silhouette_core.motion.pose import Pose
from silhouette_core.network_files import installed_network
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.corrections import Correction, read_corrections
from voxelpose.export.tables import HYPOTHESES, Hypothesis, read_hypotheses
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import surface
from voxelpose.multiview.carving.observe import FrameObservation, HullObserver, body_rule
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX
from voxelpose.multiview.tuning import CARVING
from voxelpose.people_marks import display_name
from voxelpose.recording.folder import Recording, open_readers
from voxelpose.recording.input_digests import changes_since
from voxelpose.results import Result, corrections_home, is_result, names_of, open_people
from voxelpose.view.images.figure import PartPoses, skeleton_bones, skeleton_joints
from voxelpose.view.viewer.outer_voxels import NearestBodies, OuterVoxels
from voxelpose.view.viewer.scene import BodyState, CameraFrame, CameraFrames, CarvedHull, Scene

_KEPT = 24  # frames whose scenes stay in memory
_DEFAULT_FPS = 25


class FittedBody:
    """Skin, skeleton and volume of one motion's body."""

    def __init__(self, motion: Motion, voxel_size_m: float) -> None:
        """Fills the body, one point per voxel of the given size."""
        self.motion = motion
        self.volume = BodyVolume.from_model(motion.model, voxel_size_m, "cpu")
        self._parts = motion.parts()

    def state(self, row: int) -> BodyState:
        """The body in a row of the motion."""
        model, quality = self.motion.model, self.motion.quality
        placed = self.parts(row)
        overlap = quality.get("part_overlap")
        agreement = quality.get("outline_agreement")
        return BodyState(
            kinematics.skin(model, *placed),
            skeleton_joints(model, *placed),
            skeleton_bones(model),
            model.names,
            np.full(len(model.names), np.nan) if overlap is None else np.array(overlap[row], float),
            None if agreement is None else float(agreement[row]),
        )

    def parts(self, row: int) -> PartPoses:
        """Where the parts are in a row of the motion."""
        rotation, origin = self._parts
        return rotation[row], origin[row]

    def pose(self, row: int) -> Pose:
        """The pose in a row of the motion."""
        motion = self.motion
        rotation = kinematics.rotation_matrices(motion.root_quaternion[row])
        return Pose(motion.root_m[row], rotation, motion.angles_rad[row])

    def points(self, row: int) -> list[NDArray[np.float64]]:
        """Points (n, 3), metres, that fill each part in a row of the motion."""
        placed = zip(self.volume.part_points, *self.parts(row), strict=True)
        return [points @ rotation.T + origin for points, rotation, origin in placed]


@dataclass(frozen=True, eq=False)
class OtherResult:
    """A result that is shown beside another: its name, and everybody's poses, upright."""

    name: str
    motions: tuple[Motion, ...]
    names: tuple[str, ...]

    @classmethod
    def open(cls, folder: Path, fps: float) -> "OtherResult":
        """Opens a result of a recording of so many frames per second. InputError where it is none,
        or of another rate: it is no other result of the same recording.
        """
        results = open_people(folder)
        motion = results[0].motion
        if abs(motion.fps - fps) > 0.01 * fps:
            raise InputError(
                f"{folder} has {motion.fps:g} frames per second and the first result {fps:g}: show"
                " results of one recording side by side"
            )
        return cls(
            folder.resolve().name,
            tuple(one.motion.upright() for one in results),
            tuple(names_of(results)),
        )


class ResultScenes:
    """Scenes of a result, of one person or several, or of a recording alone."""

    def __init__(
        self,
        folder: Path | str,
        recording: Path | None = None,
        voxel_size_m: float | None = None,
        unit: str | None = None,
    ):
        """Opens a folder; `recording` is where a result's recording is now, if it was moved, and
        `unit` that of its calibration, where it states none. Voxels are as in the fit if no size is
        given. InputError where it is neither, or damaged.
        """
        folder = Path(folder)
        self.reopened = partial(ResultScenes, folder, recording, voxel_size_m, unit)
        self.home, person = corrections_home(folder)  # where corrections are kept, and whose
        self.corrections: tuple[Correction, ...] = ()
        self.people: list[int] = []  # numbers of those who are shown, where there are several
        self.title, self.name = str(folder), folder.resolve().name
        self.recording: Recording | None = None
        self.missing = self.changed = ""  # why the recording is, and what did since the fit
        self.motions: tuple[Motion, ...] = ()  # everybody's poses; none for a recording alone
        self.names: tuple[str, ...] = ()  # of people, as long as the motions
        settings: Mapping[str, Any] = {}
        self.facts: Mapping[str, Any] = {}  # what the fit noted in summary.json
        self._hypotheses: Mapping[int, tuple[Hypothesis, ...]] = {}
        if is_result(folder):
            results = open_people(folder)  # who have the cameras and the frames in common
            result = results[0]
            self.corrections = read_corrections(self.home)
            if self.home != folder or len(results) > 1:
                self.people = [*range(person, person + len(results))]
            settings, self.facts = result.settings, result.summary["facts"]  # type: ignore[assignment]
            frame = result.motion.upright_frame
            self.motions = tuple(one.motion.upright() for one in results)
            self.names = tuple(names_of(results))
            self.rig, self.fps = frame.rig(result.rig), result.motion.fps
            tree = result.motion.model.tree
            self._hypotheses = {
                number: tuple(replace(pose, joints_m=frame.points(pose.joints_m)) for pose in poses)
                for number, poses in read_hypotheses(result.folder / HYPOTHESES, tree).items()
            }
            self._reopen(result, recording, unit)
        else:
            readers, *_ = open_readers(folder)
            lone = list(readers) if len(readers) == 1 else None  # which needs no calibration
            self.recording = open_fitted_recording(folder, None, lone, unit, None)
            self.rig = self.recording.upright_frame().rig(self.recording.rig)
            self.fps = self.recording.fps
            self.frames = np.arange(self.recording.numbers[-1] + 1)  # their numbers, (T,) int64
        self.estimator = str(settings.get("estimator", ""))  # that made the poses; "": none did
        options = settings.get("options", {})
        self.voxel_size_m = float(voxel_size_m or options.get("voxel_size_m", CARVING.voxel_m))
        self.lenses = {
            camera.name: UndistortedView.from_camera(camera, LONG_SIDE_PX) for camera in self.rig
        }
        self.background = settings.get("background", "auto")
        self.reader = None  # of pictures and silhouettes
        if self.recording:
            network = installed_network() if self.facts.get("network") else None
            self.reader = CameraFrames(self.recording, self.background, self.lenses, network)
        self._cameras = tuple(view.pinhole for view in self.lenses.values())
        self._fitted = [FittedBody(motion, self.voxel_size_m) for motion in self.motions]
        #: time, s, of every frame in which somebody has a pose
        self.time_s = posed_times(self.motions)
        unknown = self.reader.unknown if self.reader else None
        self.views = PinholeViews.from_rig(Rig(self._cameras), unknown)
        tolerance = int(options.get("tolerance", 0))
        self.rule = body_rule(len(self.rig), tolerance, self.views.partly_unknown)
        # That can be set by hand, of one person filmed by several cameras.
        self.joint_names: tuple[str, ...] = ()
        if self.motions and not self.people and self.recording and len(self.rig) > 1:
            self.joint_names = self.motions[0].model.tree.landmark_names
        self.has_hypotheses = bool(self._hypotheses)  # of a monocular track
        self._scene = lru_cache(_KEPT)(self._make_scene)

    def scene(self, frame: int) -> Scene:
        """The scene of one of `frames`. InputError where the recording cannot be read."""
        return self._scene(frame)

    def camera_frames(self, frame: int) -> tuple[CameraFrame, ...]:
        """Pictures and silhouettes of a frame, without carving."""
        return self.reader.read(frame) if self.reader else tuple(map(CameraFrame, self._cameras))

    def bodies(self, frame: int) -> tuple[BodyState | None, ...]:
        """The fitted bodies of a frame; None where one was not found."""
        return tuple(posed and posed[0].state(posed[1]) for posed in self._posed_bodies(frame))

    def part_poses(self, frame: int) -> list[PartPoses | None]:
        """Where the parts of the fitted bodies are in a frame; None where one was not found."""
        return [posed and posed[0].parts(posed[1]) for posed in self._posed_bodies(frame)]

    def joint_place(
        self, joint: str, frame: int, pixels: Sequence[tuple[str, float, float]]
    ) -> NDArray[np.float64]:
        """Where a joint is (3,), in the world of the calibration, m, that cameras show at pixels of
        their pictures, by their names: nearest to all rays; along a single one, to where it was.
        InputError where there is no such joint or pose.
        """
        motion = self.motions[0]
        names, rows = motion.model.tree.landmark_names, np.flatnonzero(motion.frames == frame)
        if joint not in names or not len(rows):
            raise InputError(f"frame {frame} has no pose of a joint {joint[:40]!r}: choose another")
        near_m = motion.select(rows).landmarks()[0, names.index(joint)]
        cameras = [(self.lenses[name].pinhole, (x, y)) for name, x, y in pixels]
        origins = np.array([camera.center_m - near_m for camera, _ in cameras]).reshape(-1, 3)
        rays = np.array([camera.rays([pixel])[1][0] for camera, pixel in cameras]).reshape(-1, 3)
        return motion.upright_frame.world_points(near_m + nearest_point(origins, rays))

    def _posed_bodies(self, frame: int) -> list[tuple[FittedBody, int] | None]:
        """The fitted bodies with the rows of their motions that hold a frame."""
        posed: list[tuple[FittedBody, int] | None] = []
        for fitted in self._fitted:
            rows = np.flatnonzero(fitted.motion.frames == frame).tolist()
            posed.append((fitted, rows[0]) if rows else None)
        return posed

    def close(self) -> None:
        """Stops reading."""
        if self.reader:
            self.reader.close()

    def _reopen(self, result: Result, moved: Path | None, unit: str | None) -> None:
        """Opens the recording of a result, or states why it is missing."""
        settings: Any = result.settings
        numbers = result.motion.frames
        folder = moved or (result.folder / settings.get("recording", "")).resolve()
        first, stop = settings.get("frames") or (int(numbers[0]), int(numbers[-1]) + 1)
        self.frames = np.arange(first, stop)
        if not folder.is_dir():
            self.missing = (
                f"the recording {folder} of this result is not there any more: say where with"
                " --recording"
            )
            return
        try:
            names = list(result.rig.names)
            label = result.settings.get("label")
            recording = open_fitted_recording(
                folder, (first, stop), names, unit, result.motion.fps, str(label) if label else None
            )
            noted: Any = result.summary.get("inputs", {})
            self.changed = changes_since(noted, recording, settings.get("estimator", ""))
            self.recording = replace(recording, rig=self.rig)
        except InputError as error:
            self.missing = f"the recording cannot be read: {error}"

    def _make_scene(self, frame: int) -> Scene:
        notes = [words for words in (self.missing, self.changed) if words]
        camera_frames, people = self.camera_frames(frame), self._posed_bodies(frame)
        posed = [camera_frame for camera_frame in people if camera_frame is not None]
        if self.motions and not posed:
            notes.append("no pose was found in this frame")
        elif len(posed) < len(people):
            names = zip(self.names, people, strict=True)
            lost = [display_name(name) for name, camera_frame in names if camera_frame is None]
            notes.append(f"no pose of {', '.join(lost)} was found in this frame")
        if self.recording is not None and frame not in self.recording.numbers:
            notes.append("a camera lost this frame: the one before is shown")
        for camera_frame in camera_frames:
            if camera_frame.unknown is not None and camera_frame.unknown.any():
                share = 100 * camera_frame.unknown.mean()
                notes.append(f"{share:.0f} % of {camera_frame.camera.name} is marked as unknown")
        observation = self._observe(camera_frames, posed, notes)
        hull = None if observation is None else _hull(observation, people)
        time_s = self.time_s.get(frame, frame / self.fps)
        hypotheses = self._hypotheses.get(frame, ())
        bodies, noted = self.bodies(frame), tuple(notes)
        return Scene(frame, time_s, camera_frames, hull, bodies, self.names, hypotheses, noted)

    def _observe(
        self,
        camera_frames: tuple[CameraFrame, ...],
        posed: Sequence[tuple[FittedBody, int]],
        notes: list[str],
    ) -> FrameObservation | None:
        """Observation of a frame, carved as by the multi-view estimator; if none, notes why."""
        masks = [frame.mask for frame in camera_frames if frame.mask is not None]
        if len(self.rig) < 2:
            notes.append("one camera leaves no voxels to carve")
        elif masks:
            places_m = [fitted.motion.root_m[row] for fitted, row in posed] or [None]
            try:
                volume, views = self.volume(masks), self.views
                observer = HullObserver(views, volume, self.voxel_size_m, self.rule)
                observation = observer.observe_people(views.without_unknown(masks), places_m)
            except InputError as error:
                notes.append(str(error))
            else:
                if observation is None:
                    notes.append("the silhouettes leave no hull of a body's size")
                return observation
        return None

    def volume(self, masks: list[NDArray[np.bool_]]) -> VoxelGrid:
        """Where bodies may be: around the motions, or around silhouettes (h, w) bool, one per
        camera, where there is none.
        """
        coarse_m = 2 * self.voxel_size_m
        if not self.motions:
            unknown = self.views.unknown
            return place_grid(self.views.rig, masks, coarse_m, rule=self.rule, unknown=unknown)
        root = np.concatenate([motion.root_m for motion in self.motions])
        reach_m = 1.3  # of a body from its root: an arm's length above the head
        return VoxelGrid.from_bounds(root.min(0) - reach_m, root.max(0) + reach_m, coarse_m)


def _hull(
    observation: FrameObservation, people: Sequence[tuple[FittedBody, int] | None]
) -> CarvedHull:
    """Surface of an observed hull, and the bodies in rows next to it."""
    grid, occupancy = observation.grid, observation.occupancy
    vertices, faces = surface(*grid.cropped(occupancy))
    points = [posed[0].points(posed[1]) if posed else [] for posed in people]
    bodies = NearestBodies.of_hull(observation, points)
    outer = OuterVoxels.from_hull(observation, vertices, bodies)
    return CarvedHull(grid, occupancy, vertices, faces, bodies, outer)


def open_fitted_recording(
    folder: Path,
    frames: tuple[int, int] | None,
    cameras: list[str] | None,
    unit: str | None,
    fps: float | None,
    label: str | None = None,
) -> Recording:
    """Opens a recording of which a fit may have known more than its files state.

    Its own frame rate is used where there is one that agrees with the fit's, else the fit's, else a
    default. A fit has its cameras in metres already: there the unit of the recording's calibration
    does not matter.
    """
    failure = None
    for tried_unit in (unit, "m") if unit is None and fps is not None else (unit,):
        for tried_fps in (None, fps or _DEFAULT_FPS):
            try:
                recording = Recording.open(folder, frames, cameras, tried_unit, tried_fps, label)
            except InputError as error:
                failure = error if tried_unit == unit else failure
                continue
            if tried_fps is not None or fps is None or abs(recording.fps - fps) < 0.01 * fps:
                return recording
    raise failure or InputError(f"{folder} cannot be opened")
