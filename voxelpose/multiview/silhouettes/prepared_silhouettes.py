"""Silhouettes of a whole recording, ready for fitting: background subtracted, cameras checked, the
world upright, what was missed completed.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from calib.camera import Rig
from calib.checks import BoolArray, FloatArray, IntArray
from calib.moments import even_moments
from calib.upright import UprightFrame
from silhouette_core.estimator import Frame, FrameSource, Settings
from silhouette_core.image.cleanup import clean
from silhouette_core.image.plausibility import check_plausible, telling_frames
from silhouette_core.image.seen_joints import SeenJoints, joints_of_silhouette
from silhouette_core.image.seen_people import SeenPeople, people_masks, people_seen
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.multiview.carving.bounds import LEAST_CAMERAS, place_grid, require_foreground
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.silhouettes.camera_repair import RepairedCameras, repair_cameras
from voxelpose.multiview.silhouettes.completion import SilhouetteCompletion
from voxelpose.multiview.silhouettes.hull_size import check_hull_size
from voxelpose.multiview.silhouettes.mask_store import MaskStore, mask_stores
from voxelpose.multiview.silhouettes.up_search import choose_upright
from voxelpose.multiview.tuning import CARVING

LONG_SIDE_PX = 960
"""Larger images are reduced: contours are finer there than clothes are."""
_VOLUME_FRAMES = 60
_TOGETHER = 16  # frames
_RECHECKS = 3


@dataclass(frozen=True)
class PreparationSettings:
    """How silhouettes are prepared."""

    voxel_size_m: float  #: size of the voxels that are matched.
    tolerance: int  #: number of cameras that may be wrong about a voxel.
    repair: str  #: "auto", "say" or "off": what is done about cameras that do not agree.
    joined_m: float = 0.0  #: see `HullObserver`.
    person: bool = True  #: whether the body is a person.


@dataclass(frozen=True, eq=False)
class Footage:
    """Pictures of which silhouettes are made."""

    source: FrameSource  #: the frames.
    settings: Settings  #: background subtraction.
    lenses: Sequence[UndistortedView]  #: of all cameras.
    late_frames: Mapping[str, int]
    """How many frames later than the others a camera's pictures are, by its name."""
    people: SeenPeople | None = None  #: whom the pose network sees; None: it is not asked.

    @property
    def late(self) -> list[int]:
        """`late_frames` of all cameras, in their order."""
        return [self.late_frames.get(name, 0) for name in self.source.rig.names]

    def joints(self, camera: int, t: int, mask: BoolArray) -> SeenJoints | None:
        """Joints that the network sees of the person with a silhouette, see `JointsOf`."""
        name = self.source.rig.names[camera]
        if self.people is None:
            return None
        people = self.people.of(name, t + self.late_frames.get(name, 0))
        return joints_of_silhouette(people, self.source.rig[name], mask)

    def people_masks(self, t: int) -> list[list[BoolArray]]:
        """Where the network sees each of the people in a frame, (h, w) bool by pinhole camera."""
        frame_masks: list[list[BoolArray]] = []
        for camera, late, lens in zip(self.source.rig, self.late, self.lenses, strict=True):
            people = {} if self.people is None else self.people.of(camera.name, t + late)
            size = lens.pinhole.size
            masks = people_masks(people, size[0] / camera.size[0], size)
            frame_masks.append([lens.undistort(mask) for mask in masks])
        return frame_masks

    def people_counted(self, t: int) -> IntArray | None:
        """Number of people in a frame (C,) whom the network sees; None: it is not asked."""
        if self.people is None:
            return None
        pairs = zip(self.source.rig.names, self.late, strict=True)
        return np.array([self.people.count(name, t + late) for name, late in pairs])

    def silhouettes(self) -> Silhouettes:
        """The background."""
        background = self.settings.background
        return Silhouettes(self.source, background, LONG_SIDE_PX, people=self.people)


@dataclass(frozen=True, eq=False)
class PreparedSilhouettes:
    """Silhouettes of T frames and C cameras."""

    store: MaskStore  #: the silhouettes, by pinhole cameras.
    observer: HullObserver  #: of their hulls, in the upright frame.
    upright: UprightFrame  #: that frame, in the calibration's world.
    rig: Rig  #: the pinhole cameras in the calibration's world, as they were found to stand.
    numbers: np.ndarray  #: (T,) int64, frames of the recording.
    times_s: FloatArray  #: (T,) float64.
    facts: dict[str, object]  #: what was found, for the summary.
    settings: PreparationSettings  #: by which they were prepared.
    footage: Footage  #: from which.
    estimated: BoolArray  #: (C,) whether the background is estimated from the recording.

    def blind_cameras(self) -> BoolArray:
        """(T, C) bool: cameras that tell nothing of a frame: a late one has no picture of it, or
        the pose network sees nobody where others see somebody. Who stands still is part of a
        background that is estimated from the recording.
        """
        steps = np.arange(len(self.store))[:, None] + self.footage.late
        blind = (steps < 0) | (steps >= len(self.store))
        counts = [self.footage.people_counted(t) for t in range(len(self.store))]
        for row, count in zip(blind, counts, strict=True):
            if count is not None and np.count_nonzero(count) >= LEAST_CAMERAS:
                row |= self.estimated & (count == 0)
        return blind

    @contextmanager
    def without(self, hidden: Sequence[np.ndarray]) -> "Iterator[PreparedSilhouettes]":
        """The same for a `with` block, with more that is unknown: C arrays (h, w) bool."""
        marked = self.observer.views.unknown or [np.False_] * len(hidden)
        unknown = tuple(new | old for new, old in zip(hidden, marked, strict=True))
        views = PinholeViews.from_rig(self.observer.views.rig, unknown)
        with closing(MaskStore([camera.size for camera in views.rig], len(self.store))) as store:
            for t in range(len(store)):
                store.put(t, views.without_unknown(self.store[t]))
            observer = observer_of(views.rig, store, self.settings, unknown)
            yield replace(self, store=store, observer=observer)


@contextmanager
def prepare_silhouettes(
    source: FrameSource,
    settings: Settings,
    preparation: PreparationSettings,
    clock: StageClock,
    reporter: Reporter,
) -> Iterator[PreparedSilhouettes]:
    """Prepares the silhouettes of a recording, which are kept on disk for the `with` block. Raises
    InputError where a background cannot be used, or nobody is seen.

    Args:
        source: the frames.
        settings: background subtraction, and what is known of the person and of up.
        preparation: see PreparationSettings.
        clock: told the durations.
        reporter: told the progress, and what was found about the cameras.
    """
    lenses = [UndistortedView.from_camera(camera, LONG_SIDE_PX) for camera in source.rig]
    sizes = [lens.pinhole.size for lens in lenses]
    with mask_stores(2, sizes, source.frame_count) as stores:
        reporter.stage("masks" if source.silhouettes_given else "background")
        people = people_seen(source, settings, reporter)
        silhouettes = Footage(source, settings, lenses, {}, people).silhouettes()
        silhouettes.note(reporter)
        unknown = unknown_views(silhouettes.unknown, lenses)
        pairs = zip(source.rig.names, unknown or (), strict=unknown is not None)
        shares = {name: round(float(mask.mean()), 4) for name, mask in pairs if mask.any()}
        if shares:
            listed = ", ".join(f"{100 * share:.0f} % of {name}" for name, share in shares.items())
            reporter.note(f"marked as unknown, and left out: {listed}")
        work = _Preparation(source, stores, unknown, preparation, clock, reporter)
        numbers, times_s = work.subtract_background(silhouettes, lenses)
        pinholes = Rig(tuple(lens.pinhole for lens in lenses))
        work.refuse_implausible(lenses, pinholes, settings.stature_m, len(shares))
        checked = work.check_cameras(pinholes, times_s)
        reporter.stage("volume")
        upright = choose_upright(
            checked.rig, settings, stores[0], work.observer, reporter, person=preparation.person
        )
        checked, added = work.complete_all(checked, upright, times_s)
        for words in checked.words:
            reporter.note(words)
        facts: dict[str, object] = {
            "unknown_share": shares,
            "by_texture": silhouettes.by_texture,
            "network": silhouettes.network,
            "moving_cameras": silhouettes.moving,
            "cameras_found": list(checked.words),
            "late_frames": checked.late_frames,
            **added,
        }
        observer = work.observer(upright.rig(checked.rig))
        yield PreparedSilhouettes(
            stores[0],
            observer,
            upright,
            checked.rig,
            numbers,
            times_s,
            facts,
            preparation,
            Footage(source, settings, lenses, checked.late_frames, people),
            np.isin(source.rig.names, silhouettes.without_background),
        )


@dataclass(frozen=True, eq=False)
class _Preparation:
    """Steps of the preparation; `stores` are of silhouettes and of differences of tint, `unknown`
    is as of `PinholeViews`.
    """

    source: FrameSource
    stores: list[MaskStore]
    unknown: tuple[np.ndarray, ...] | None
    settings: PreparationSettings
    clock: StageClock
    reporter: Reporter

    def subtract_background(
        self, silhouettes: Silhouettes, lenses: list[UndistortedView]
    ) -> tuple[np.ndarray, FloatArray]:
        """Stores the soft silhouettes of all frames; frame numbers (T,) and times (T,) s."""
        source, reporter = self.source, self.reporter
        views = PinholeViews.from_rig(Rig(tuple(lens.pinhole for lens in lenses)), self.unknown)
        reporter.stage("silhouettes", source.frame_count)
        numbers, times_s = np.zeros(source.frame_count, np.int64), np.zeros(source.frame_count)
        frames: Mapping[str, Frame]
        for t, (number, seconds, frames) in enumerate(source):
            with self.clock("silhouettes"):
                soft = silhouettes.soft(frames, t)
                for store, kind in zip(self.stores, ("silhouette", "tint"), strict=True):
                    masks = (getattr(soft[name], kind) for name in source.rig.names)
                    pairs = zip(lenses, masks, strict=True)
                    store.put(t, views.without_unknown([lens.undistort(m) for lens, m in pairs]))
            numbers[t], times_s[t] = number, seconds
            reporter.advance()
        return numbers, times_s

    def refuse_implausible(
        self, lenses: list[UndistortedView], rig: Rig, stature_m: float | None, partly_unknown: int
    ) -> None:
        """Refuses silhouettes that cannot be those of a body, or of a person of such a stature."""
        source, person, store = self.source, self.settings.person, self.stores[0]
        moments = [store[t] for t in telling_frames(len(store))]
        check_plausible(
            dict(zip(rig.names, zip(*moments, strict=True), strict=True)),
            least=LEAST_CAMERAS,
            person=person,
            lenses=dict(zip(rig.names, lenses, strict=True)),
            given=source.silhouettes_given,
        )
        if person:
            rule = body_rule(len(rig), self.settings.tolerance, partly_unknown)
            check_hull_size(rig, moments[::6], rule, stature_m, self.unknown)

    def check_cameras(self, rig: Rig, times_s: FloatArray) -> RepairedCameras:
        """Cameras checked against the silhouettes, which are put in step where one is late."""
        if self.settings.repair == "off":
            return RepairedCameras(rig, {})
        self.reporter.stage("cameras")
        with self.clock("cameras"):
            checked = repair_cameras(
                rig,
                self.stores[0],
                times_s,
                self.source.fps,
                put_right=self.settings.repair == "auto",
                unknown=self.unknown,
            )
        for store in self.stores:
            store.advance([checked.late_frames.get(name, 0) for name in rig.names])
        return checked

    def check_again(
        self, checked: RepairedCameras, upright: UprightFrame, times_s: FloatArray
    ) -> RepairedCameras:
        """Checks cameras that are in doubt again: gaps of the silhouettes may have hidden which it
        is, or by how much. Completes what is missing by those that were put right.
        """
        for _ in range(_RECHECKS):
            if not checked.in_doubt:
                break
            checked = checked.then(self.check_cameras(checked.rig, times_s))
            if not checked.repaired:
                break
            self.complete(upright.rig(checked.rig))
        return checked

    def complete_all(
        self, checked: RepairedCameras, upright: UprightFrame, times_s: FloatArray
    ) -> tuple[RepairedCameras, dict[str, object]]:
        """Completes the silhouettes, and checks cameras in doubt again; the cameras, and what share
        of each camera's pixels was added.
        """
        before = self.stores[0].pixels()
        self.complete(upright.rig(checked.rig))
        checked = self.check_again(checked, upright, times_s)
        shares = 1 - before / np.maximum(self.stores[0].pixels(), 1)
        pairs = zip(self.source.rig.names, shares.round(4).tolist(), strict=True)
        return checked, {"completed": dict(pairs)}

    def complete(self, rig: Rig) -> None:
        """Completes the silhouettes of all frames."""
        store, observer = self.stores[0], self.observer(rig)
        completion = SilhouetteCompletion(observer.views, observer.volume, observer.rule)
        self.reporter.stage("completion", len(store))

        def completed(t: int) -> list[np.ndarray]:
            return completion.complete(*(completed_masks[t] for completed_masks in self.stores))

        for first in range(0, len(store), _TOGETHER):
            together = range(first, min(first + _TOGETHER, len(store)))
            with self.clock("completion"):
                completed_masks = side_by_side(completed, together)
            for t, masks in zip(together, completed_masks, strict=True):
                store.put(t, masks)
                self.reporter.advance()

    def observer(self, rig: Rig) -> HullObserver:
        """Observer of hulls by some cameras."""
        return observer_of(rig, self.stores[0], self.settings, self.unknown)


def unknown_views(
    unknown: Mapping[str, np.ndarray], lenses: Sequence[UndistortedView]
) -> tuple[np.ndarray, ...] | None:
    """Unknown places (h, w) bool as of `PinholeViews`; None where there are none.

    Args:
        unknown: by camera name, as recorded.
        lenses: of all cameras.
    """
    if not unknown:
        return None
    return tuple(
        lens.undistort_unknown(unknown[lens.pinhole.name])
        if lens.pinhole.name in unknown
        else np.zeros(lens.pinhole.size[::-1], np.bool_)
        for lens in lenses
    )


def observer_of(
    rig: Rig,
    store: MaskStore,
    settings: PreparationSettings,
    unknown: Sequence[np.ndarray] | None = None,
) -> HullObserver:
    """Observer of the volume in which the silhouettes of the whole recording allow a body."""
    views = PinholeViews.from_rig(rig, unknown)

    def moments() -> Iterator[list[np.ndarray]]:
        for t in even_moments(len(store), _VOLUME_FRAMES, margin=0).tolist():
            yield [clean(mask, min_share=CARVING.bounding) for mask in store[t]]  # without specks

    union = [np.zeros_like(mask) for mask in store[0]]
    for masks in moments():
        for whole, mask in zip(union, masks, strict=True):
            whole |= mask
    require_foreground(rig, union, settings.tolerance)
    rule = body_rule(len(rig), settings.tolerance, views.partly_unknown)
    size_m = 2 * settings.voxel_size_m
    grid = place_grid(rig, union, size_m, rule=rule, unknown=unknown, moments=moments())
    return HullObserver(
        views, grid, settings.voxel_size_m, rule, settings.joined_m, settings.person
    )
