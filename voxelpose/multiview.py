"""The multi-view estimator: silhouettes of calibrated cameras in, motion out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Estimate, FrameSource, Settings
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.jit import set_threads
from silhouette_core.motion.kinematics import quaternions, rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.smoothing import smooth, smooth_quaternions
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.pose import Pose
from voxelpose.carving.bounds import place_grid, require_foreground
from voxelpose.matching.adaptation import stature_of
from voxelpose.matching.body_choice import choose_body, refit
from voxelpose.matching.mask_store import MaskStore
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import HullObserver, body_rule
from voxelpose.matching.quality import assess
from voxelpose.matching.tracking import PoseTracker, PoseTrackerSettings
from voxelpose.recording.frame_reader import Frame

LONG_SIDE_PX = (
    960  # larger pictures are fitted at this size: contours are finer there than clothes are
)
VOXEL_M = 0.025
_VOLUME_FRAMES = 60


@dataclass(frozen=True)
class _Options:
    """What only this estimator is told, checked.

    Attributes:
        interference: match interfering parts together.
        voxel_size_m: of the voxels that are matched.
        tolerance: cameras that may be wrong about a voxel.
    """

    interference: bool = True
    voxel_size_m: float = VOXEL_M
    tolerance: int = 0

    @classmethod
    def read(cls, options: Mapping[str, object]) -> _Options:
        unknown = sorted(set(options) - set(cls.__dataclass_fields__))
        if unknown:
            raise InputError(
                f"the multi-view estimator has no option {unknown[0]!r}: it has"
                f" {', '.join(cls.__dataclass_fields__)}"
            )
        read = cls(**options)  # type: ignore[arg-type]
        if not 0.005 <= read.voxel_size_m <= 0.1:
            raise InputError(
                f"voxels of {read.voxel_size_m} m cannot be matched: choose from 0.005 to 0.1, for"
                " example 0.025"
            )
        return read


class MultiViewEstimator:
    """Estimates motion from two or more calibrated cameras.

    Source: Iiyama, Kameda and Minoh for the matching of voxels; the rest (root placement,
    proportions, refinement on the silhouettes, tracking) goes beyond the paper, see docs/papers.md.
    """

    name = "multiview"

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        options = _Options.read(settings.options)
        if len(source.rig) < 2:
            raise InputError(
                f"{len(source.rig)} camera is too few for voxels: give at least two calibrated"
                " cameras that see the person"
            )
        if settings.stature_m is not None:
            BodySizes(
                settings.stature_m, settings.chest_m, settings.sex
            )  # refuses what is no person's, before any work is done
        set_threads(settings.threads)
        clock = StageClock()
        lenses = [UndistortedView.of(camera, LONG_SIDE_PX) for camera in source.rig]
        views = PinholeViews.of(Rig(tuple(lens.pinhole for lens in lenses)))
        store = MaskStore([lens.pinhole.size for lens in lenses], source.frame_count)
        try:
            numbers, times = _store_silhouettes(source, settings, lenses, store, clock, reporter)
            observer = _observer(views, store, options, reporter)
            track, facts = _track(observer, store, settings, options, source.fps, clock, reporter)
            motion = _motion(track, settings, source.fps, numbers, times, clock, reporter)
        finally:
            store.close()
        return Estimate(
            motion, {stage: np.array(seconds) for stage, seconds in clock.seconds.items()}, facts
        )


def _store_silhouettes(
    source: FrameSource,
    settings: Settings,
    lenses: list[UndistortedView],
    store: MaskStore,
    clock: StageClock,
    reporter: Reporter,
) -> tuple[np.ndarray, np.ndarray]:
    """Fills the store; returns frame numbers (T,) and times (T,) s."""
    reporter.stage("background")
    silhouettes = Silhouettes(source, settings.background, LONG_SIDE_PX)
    if silhouettes.without_background:
        reporter.note(
            f"no picture of the empty view for {', '.join(silhouettes.without_background)}: the"
            " temporal median stands in for it"
        )
    reporter.stage("silhouettes", source.frame_count)
    numbers, times = np.zeros(source.frame_count, np.int64), np.zeros(source.frame_count)
    frames: Mapping[str, Frame]
    for t, (number, seconds, frames) in enumerate(source):
        with clock("silhouettes"):
            masks = silhouettes.of(frames)
            store.put(
                t,
                [
                    lens.undistort(masks[camera.name])
                    for lens, camera in zip(lenses, source.rig, strict=True)
                ],
            )
        numbers[t], times[t] = number, seconds
        reporter.advance()
    return numbers, times


def _observer(
    views: PinholeViews, store: MaskStore, options: _Options, reporter: Reporter
) -> HullObserver:
    """Places the volume where the silhouettes of the whole recording allow a body."""
    reporter.stage("volume")
    union = store[0]
    for t in np.unique(np.linspace(0, len(store) - 1, min(len(store), _VOLUME_FRAMES)).astype(int)):
        union = [whole | mask for whole, mask in zip(union, store[int(t)], strict=True)]
    require_foreground(views.rig, union, options.tolerance)
    rule = body_rule(len(views.rig), options.tolerance)
    grid = place_grid(views.rig, union, voxel_size_m=2 * options.voxel_size_m, rule=rule)
    return HullObserver(views, grid, options.voxel_size_m, rule)


def _track(
    observer: HullObserver,
    store: MaskStore,
    settings: Settings,
    options: _Options,
    fps: float,
    clock: StageClock,
    reporter: Reporter,
) -> tuple[PoseTracker, dict[str, object]]:
    reporter.stage("first poses")
    with clock("first poses"):
        start = choose_body(
            observer, store, settings, MatchSettings(interference=options.interference), reporter
        )
    track = PoseTracker(
        start.body,
        observer,
        store,
        PoseTrackerSettings(fps, MatchSettings(interference=options.interference)),
        clock,
        reporter.advance,
    )
    reporter.stage("tracking", len(store))
    track.begin(start.poses, start.errors)
    reporter.stage("repair")
    with clock("repair"):
        track.repair(3 + len(store) // 100)
    reporter.stage("limbs")
    track.recheck()
    reporter.stage("proportions")
    with clock("proportions"):
        refit(track, start)
    reporter.stage("refinement", len(store))
    track.polish()
    facts = {
        "stature_m": stature_of(track.body.model),
        "stature_given": settings.stature_m is not None,
        "sex_template": start.body.model.sizes.sex,
        "voxel_size_m": observer.voxel_size_m,
        "anchor_frames": sorted(start.poses),
        "shape": dict(
            zip(start.shape_names, track.body.model.shape.round(4).tolist(), strict=True)
        ),
        "silhouette_error": {
            "median": (
                float(np.median(track.error[np.isfinite(track.error)]))
                if np.isfinite(track.error).any()
                else None
            )
        },
    }
    return track, facts


def _motion(
    track: PoseTracker,
    settings: Settings,
    fps: float,
    numbers: np.ndarray,
    times: np.ndarray,
    clock: StageClock,
    reporter: Reporter,
) -> Motion:
    posed = [t for t, pose in enumerate(track.poses) if pose is not None]
    poses = [pose for pose in track.poses if pose is not None]
    if not poses:
        raise InputError(
            "no body was found in any frame: look at the hull with `voxelpose carve`, and check"
            " background and calibration"
        )
    root, angles = (
        np.stack([pose.root_m for pose in poses]),
        np.stack([pose.angles_rad for pose in poses]),
    )
    rotation = quaternions(np.stack([pose.root_rotation for pose in poses]))
    if settings.smooth:
        for run in np.split(np.arange(len(posed)), np.flatnonzero(np.diff(posed) > 1) + 1):
            root[run], angles[run] = smooth(root[run], fps), smooth(angles[run], fps)
            rotation[run] = smooth_quaternions(rotation[run], fps)
    reporter.stage("quality", len(posed))
    found = []
    for k, t in enumerate(posed):
        with clock("quality"):
            observed = track.observed(t)
            pose = Pose(
                root[k], rotation_matrices(rotation[k]), angles[k]
            )  # as written: smoothed where that was asked for
            found.append(
                None if observed is None else assess(track.body.body_volume, pose, observed)
            )
        reporter.advance()
    parts = len(track.body.model.names)
    quality = {
        "part_overlap": np.stack(
            [np.full(parts, np.nan) if q is None else q.part_overlap for q in found]
        ),
        "part_unsupported": np.stack(
            [np.zeros(parts, bool) if q is None else q.part_unsupported for q in found]
        ),
        "unexplained": np.array([np.nan if q is None else q.unexplained for q in found]),
        "confidence": np.clip(1 - track.error[posed], 0.0, 1.0),
    }
    return Motion(
        fps, track.body.model, root, rotation, angles, numbers[posed], times[posed], quality
    )
