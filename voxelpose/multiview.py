"""The multi-view estimator: silhouettes of calibrated cameras in, motion out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.agreement import even_moments
from calib.camera import Rig
from calib.checks import FloatArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Estimate, FrameSource, Settings, read_options
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.jit import set_threads
from silhouette_core.motion.floor import floor_height
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import body_of_motion
from silhouette_core.motion.smoothing import smooth_runs
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import stature_of
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.carving.bounds import place_grid, require_foreground
from voxelpose.matching.body_choice import choose_body, refit
from voxelpose.matching.camera_repair import RepairedCameras, repair_cameras
from voxelpose.matching.completion import SilhouetteCompletion, floor_under
from voxelpose.matching.mask_store import MaskStore
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.motion_quality import motion_quality
from voxelpose.matching.observation_store import ObservationStore
from voxelpose.matching.observe import HullObserver, body_rule
from voxelpose.matching.tracking import PoseTracker, PoseTrackerSettings
from voxelpose.matching.up_search import UpSearch, choose_upright
from voxelpose.recording.frame_reader import Frame

LONG_SIDE_PX = 960  # larger images are reduced: contours are finer there than clothes are
VOXEL_M = 0.025
_VOLUME_FRAMES = 60
_TOGETHER = 16  # frames
_FLOOR_FRAMES = 12
_RECHECKS = 3
_REPAIRS = "auto", "say", "off"


@dataclass(frozen=True)
class _Options:
    """Options of this estimator only.

    Attributes:
        interference: match interfering parts jointly.
        voxel_size_m: size of the voxels that are matched, 0.005 to 0.1.
        tolerance: number of cameras that may be wrong about a voxel.
        repair: what to do about a camera that was turned or whose pictures come late: "auto" puts
            it right where that is sure, "say" only tells, "off" does not look.
        body: an earlier result of the same person, whose body is kept as it is; empty: the body is
            estimated.
    """

    interference: bool = True
    voxel_size_m: float = VOXEL_M
    tolerance: int = 0
    repair: str = "auto"
    body: str = ""

    def __post_init__(self) -> None:
        """Refuses what does not exist, and voxels that cannot be matched."""
        if self.repair not in _REPAIRS:
            raise InputError(f"no repair {self.repair!r}: choose from {', '.join(_REPAIRS)}")
        if not 0.005 <= self.voxel_size_m <= 0.1:
            raise InputError(
                f"voxels of {self.voxel_size_m} m cannot be matched: choose from 0.005 to 0.1, for"
                " example 0.025"
            )


class MultiViewEstimator:
    """Estimates motion from two or more calibrated cameras.

    Source: Iiyama, Kameda and Minoh for the matching of voxels; the rest (root placement,
    proportions, refinement on the silhouettes, tracking) goes beyond the paper, see docs/papers.md.
    """

    name = "multiview"

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        options = read_options(_Options, settings.options, "multi-view")
        if len(source.rig) < 2:
            raise InputError(
                f"{len(source.rig)} camera is too few for voxels: give at least two calibrated"
                " cameras that see the person"
            )
        if settings.stature_m is not None:
            # Refuses what is no person's, before any work is done.
            BodySizes(settings.stature_m, settings.chest_m, settings.sex)
        known = body_of_motion(Path(options.body)) if options.body else None
        set_threads(settings.threads)
        clock = StageClock()
        lenses = [UndistortedView.from_camera(camera, LONG_SIDE_PX) for camera in source.rig]
        pinholes = Rig(tuple(lens.pinhole for lens in lenses))
        tracking = PoseTrackerSettings(source.fps, MatchSettings(interference=options.interference))
        sizes = [lens.pinhole.size for lens in lenses]
        with (
            closing(MaskStore(sizes, source.frame_count)) as store,
            closing(MaskStore(sizes, source.frame_count)) as tint,
            closing(MaskStore(sizes, source.frame_count)) as brightness,
        ):
            stores = store, tint, brightness
            numbers, times = _store_silhouettes(source, settings, lenses, stores, clock, reporter)
            checked = _check_cameras(pinholes, stores, times, source.fps, options, clock, reporter)
            pinholes = checked.rig
            reporter.stage("volume")
            upright = choose_upright(
                UpSearch(pinholes, settings, tracking.match),
                store,
                lambda rig: _observer(rig, store, options),
                reporter,
            )
            rig = upright.rig(pinholes)
            added = _complete(_observer(rig, store, options), stores, clock, reporter)
            for _ in range(_RECHECKS if checked.in_doubt else 0):
                # Gaps of the silhouettes may have hidden which camera it is, or by how much.
                again = _check_cameras(
                    pinholes, stores, times, source.fps, options, clock, reporter
                )
                if not again.repaired:
                    break
                checked, pinholes = checked.then(again), again.rig
                rig = upright.rig(pinholes)
                more = _complete(_observer(rig, store, options), stores, clock, reporter)
                added = 1 - (1 - added) * (1 - more)
            for words in checked.words:
                reporter.note(words)
            observer = _observer(rig, store, options)
            with closing(ObservationStore(observer, store)) as observations:
                reporter.stage("hulls", len(store))
                for first in range(0, len(store), _TOGETHER):
                    together = range(first, min(first + _TOGETHER, len(store)))
                    with clock("hulls"):
                        observations.carve(together)
                    for _ in together:
                        reporter.advance()
                tracker, facts = _track(observations, settings, tracking, known, clock, reporter)
                motion, ratio = _motion(tracker, settings, numbers, times, clock, reporter)
                facts["half_turn_ratio"] = round(ratio, 3)
                facts["cameras_found"] = list(checked.words)
                facts["late_frames"] = checked.late_frames
                facts["completed"] = dict(zip(rig.names, added.round(4).tolist(), strict=True))
        motion = replace(motion, floor_m=floor_height(motion)).in_world(upright)
        return Estimate(
            motion,
            {stage: np.array(seconds) for stage, seconds in clock.seconds.items()},
            facts,
            rig=_posed_as(source.rig, pinholes),
        )


def _posed_as(rig: Rig, pinholes: Rig) -> Rig:
    """A rig whose cameras stand as others do."""
    return Rig(
        tuple(
            replace(camera, rotation=other.rotation, translation=other.translation)
            for camera, other in zip(rig, pinholes, strict=True)
        )
    )


def _store_silhouettes(
    source: FrameSource,
    settings: Settings,
    lenses: list[UndistortedView],
    stores: Sequence[MaskStore],
    clock: StageClock,
    reporter: Reporter,
) -> tuple[np.ndarray, np.ndarray]:
    """Stores the soft silhouettes of all frames; frame numbers (T,) and times (T,) s."""
    reporter.stage("background")
    silhouettes = Silhouettes(source, settings.background, LONG_SIDE_PX)
    silhouettes.note(reporter)
    reporter.stage("silhouettes", source.frame_count)
    numbers, times = np.zeros(source.frame_count, np.int64), np.zeros(source.frame_count)
    frames: Mapping[str, Frame]
    for t, (number, seconds, frames) in enumerate(source):
        with clock("silhouettes"):
            soft = silhouettes.soft(frames)
            masks = zip(*(soft[name] for name in source.rig.names), strict=True)
            for store, seen in zip(stores, masks, strict=True):
                store.put(
                    t, [lens.undistort(mask) for lens, mask in zip(lenses, seen, strict=True)]
                )
        numbers[t], times[t] = number, seconds
        reporter.advance()
    return numbers, times


def _check_cameras(
    rig: Rig,
    stores: Sequence[MaskStore],
    times_s: FloatArray,
    fps: float,
    options: _Options,
    clock: StageClock,
    reporter: Reporter,
) -> RepairedCameras:
    """Cameras checked against the stored silhouettes, which are put in step where one is late."""
    if options.repair == "off":
        return RepairedCameras(rig, {})
    reporter.stage("cameras")
    with clock("cameras"):
        checked = repair_cameras(rig, stores[0], times_s, fps, repair=options.repair == "auto")
    for name, late in checked.late_frames.items():
        for silhouettes in stores:
            silhouettes.advance(rig.names.index(name), late)
    return checked


def _complete(
    observer: HullObserver, stores: Sequence[MaskStore], clock: StageClock, reporter: Reporter
) -> FloatArray:
    """Completes the stored silhouettes of all frames; (C,) share of each camera's pixels that was
    added.
    """
    store, *differences = stores
    reporter.stage("completion", len(store))
    moments = even_moments(len(store), _FLOOR_FRAMES)
    floor_m = floor_under(observer, [store[int(t)] for t in moments])
    completion = SilhouetteCompletion(observer.views, observer.volume, observer.rule, floor_m)
    before, after = (np.zeros(len(observer.views.rig)) for _ in range(2))

    def completed(t: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
        masks = store[t]
        return masks, completion.complete(masks, *(found[t] for found in differences))

    for first in range(0, len(store), _TOGETHER):
        together = range(first, min(first + _TOGETHER, len(store)))
        with clock("completion"):
            found = side_by_side(completed, together)
        for t, (old, new) in zip(together, found, strict=True):
            before += [np.count_nonzero(mask) for mask in old]
            after += [np.count_nonzero(mask) for mask in new]
            store.put(t, new)
            reporter.advance()
    return 1 - before / np.maximum(after, 1)


def _observer(rig: Rig, store: MaskStore, options: _Options) -> HullObserver:
    """Observer of the volume in which the silhouettes of the whole recording allow a body."""
    union = store[0]
    for t in np.unique(np.linspace(0, len(store) - 1, min(len(store), _VOLUME_FRAMES)).astype(int)):
        union = [whole | mask for whole, mask in zip(union, store[int(t)], strict=True)]
    require_foreground(rig, union, options.tolerance)
    rule = body_rule(len(rig), options.tolerance)
    grid = place_grid(rig, union, voxel_size_m=2 * options.voxel_size_m, rule=rule)
    return HullObserver(PinholeViews.from_rig(rig), grid, options.voxel_size_m, rule)


def _track(
    observations: ObservationStore,
    settings: Settings,
    tracking: PoseTrackerSettings,
    known: BodyModel | None,
    clock: StageClock,
    reporter: Reporter,
) -> tuple[PoseTracker, dict[str, object]]:
    """Poses of all frames, and facts for the summary."""
    reporter.stage("first poses")
    with clock("first poses"):
        start = choose_body(observations, settings, tracking.match, reporter, known)
    tracker = PoseTracker(start.body, observations, tracking, clock, reporter.advance)
    reporter.stage("tracking", len(observations))
    tracker.begin(start.poses, start.errors)
    reporter.stage("repair")
    with clock("repair"):
        tracker.begin_again()
        tracker.repair(3 + len(observations) // 100)
        tracker.mend_jumps()
    reporter.stage("limbs")
    tracker.recheck()
    if known is None:
        reporter.stage("proportions")
        with clock("proportions"):
            refit(tracker, start)
    reporter.stage("refinement", len(observations))
    tracker.polish()
    errors = tracker.error[np.isfinite(tracker.error)]
    facts = {
        "stature_m": stature_of(tracker.body.model),
        "stature_given": settings.stature_m is not None or known is not None,
        "sex_template": start.body.model.sizes.sex,
        "voxel_size_m": observations.observer.voxel_size_m,
        "anchor_frames": sorted(start.poses),
        "shape": dict(
            zip(start.shape_names, tracker.body.model.shape.round(4).tolist(), strict=True)
        ),
        "silhouette_error": {"median": float(np.median(errors)) if len(errors) else None},
    }
    return tracker, facts


def _motion(
    tracker: PoseTracker,
    settings: Settings,
    numbers: np.ndarray,
    times: np.ndarray,
    clock: StageClock,
    reporter: Reporter,
) -> tuple[Motion, float]:
    """Poses as a motion, smoothed if requested, with their quality, and the half-turn ratio."""
    posed = [t for t, pose in enumerate(tracker.poses) if pose is not None]
    poses = [pose for pose in tracker.poses if pose is not None]
    if not poses:
        raise InputError(
            "no body was found in any frame: look at the hull with `voxelpose carve`, and check"
            " background and calibration"
        )
    fps = tracker.settings.fps
    root = np.stack([pose.root_m for pose in poses])
    angles = np.stack([pose.angles_rad for pose in poses])
    rotation = quaternions(np.stack([pose.root_rotation for pose in poses]))
    if settings.smooth:
        smooth_runs(root, rotation, angles, np.array(posed), fps)
    motion = Motion(fps, tracker.body.model, root, rotation, angles, numbers[posed], times[posed])
    reporter.stage("quality", len(posed))
    found = motion_quality(tracker, motion, posed, clock, reporter)
    return replace(motion, quality=found.arrays), found.half_turn_ratio
