"""The multi-view estimator: silhouettes of calibrated cameras in, motion out."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import ONE_PERSONS, Estimate, FrameSource, Settings, read_options
from silhouette_core.jit import set_threads
from silhouette_core.motion.body_source import load_body
from silhouette_core.motion.conditioning import conditioned, quality_with_filled
from silhouette_core.motion.floor import floor_height
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.setting_types import Repair, VoxelSize
from voxelpose.multiview.carving.bounds import check_tolerance
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.people import PEOPLE_CAMERAS, require_cameras
from voxelpose.multiview.people.people_track import PeopleTrack, people_places
from voxelpose.multiview.people.presence import frames_of_nobody
from voxelpose.multiview.quality.quality import motion_quality
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    PreparationSettings,
    prepare_silhouettes,
)
from voxelpose.multiview.tracking.recording_track import OnePerson, TrackWork
from voxelpose.multiview.tracking.tracking import PoseTracker
from voxelpose.multiview.tuning import CARVING


@dataclass(frozen=True)
class _Options:
    """Options of this estimator only."""

    interference: bool = True  #: match interfering parts jointly.
    voxel_size_m: VoxelSize = CARVING.voxel_m  #: size of the voxels that are matched.
    tolerance: int = 0  #: number of cameras that may be wrong about a voxel.
    repair: Repair = "auto"
    """What to do about a camera that was turned or whose pictures come late: "auto" puts it right
    where that is sure, "say" only tells, "off" does not look."""
    body: str = ""
    """The body, as `load_body` names it; empty: it is estimated. Of a person's, only the clothes
    are, unless it is an earlier result, which wears those of its recording."""


class MultiViewEstimator:
    """Estimates motion from two or more calibrated cameras.

    Source: Iiyama, Kameda and Minoh for the matching of voxels; the rest (root placement,
    proportions, refinement on the silhouettes, tracking) goes beyond the paper, see docs/papers.md.
    """

    name = "multiview"
    takes_body = True

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        return self.estimate_people(source, settings, reporter, 1)[0]

    def estimate_people(
        self, source: FrameSource, settings: Settings, reporter: Reporter, people: int | None
    ) -> list[Estimate]:
        """Estimates the motion of several people; the cameras as they were found are the same.
        Raises InputError as `estimate`, and where fewer people are there, or the cameras do not
        tell them apart.

        Args:
            people: their number; None: as many as there are, one before two cameras.
        """
        options = read_options(_Options, settings.options, "multi-view")
        if len(source.rig) < 2:
            raise InputError(
                f"{len(source.rig)} camera is too few for voxels: give at least two calibrated"
                " cameras that see the person, or use `voxelpose track RECORDING --camera"
                f" {source.rig.names[0]}`, which needs one"
            )
        check_tolerance(options.tolerance, len(source.rig))
        # Refuses what is no person's, before any work is done.
        for each in (settings, *map(settings.of_person, range(len(settings.people)))):
            if each.stature_m is not None:
                BodySizes(each.stature_m, each.chest_m, each.sex)
        known = load_body(options.body, reporter.note) if options.body else None
        given = None if known is None or known.person is not None else known
        people = _looked_for(people, len(source.rig), given)
        set_threads(settings.threads)
        clock = StageClock()
        matching = MatchSettings(interference=options.interference)
        preparation = PreparationSettings(
            options.voxel_size_m,
            options.tolerance,
            options.repair,
            *((0.0, True) if given is None else (CARVING.joined * given.extent_m, False)),
        )
        with (
            prepare_silhouettes(source, settings, preparation, clock, reporter) as prepared,
            ExitStack() as resources,
        ):
            targets = settings.upright_targets(prepared.upright)
            work = TrackWork(
                replace(settings, targets=targets),
                source.fps,
                matching,
                known,
                clock,
                reporter,
                prepared.numbers,
            )
            places_m = things_m = np.empty((0, source.frame_count, 3))
            if people != 1:
                places_m, things_m = people_places(prepared, people, clock, reporter)
            if len(settings.people) > max(len(places_m), 1):
                reporter.note(
                    f"{len(settings.people)} people were told of, and {max(len(places_m), 1)} are"
                    " followed: the others are not used"
                )
            if len(places_m) < 2:
                tracked = [OnePerson(work, prepared, resources).track()]
            else:
                if known is not None or settings != settings.of_anybody:
                    reporter.note(ONE_PERSONS)
                works = [work.of_person(number) for number in range(len(places_m))]
                tracked = PeopleTrack(works, prepared, places_m, things_m, resources).track()
            absent_frames = [frames_of_nobody(prepared)]
            motions = [
                _motion(tracker, settings, prepared.numbers, prepared.times_s, clock, reporter)
                for tracker, _ in tracked
            ]
        stage_s = {stage: np.array(seconds) for stage, seconds in clock.seconds.items()}
        rig, estimates = _posed_as(source.rig, prepared.rig), []
        if len(tracked) > 1:
            absent = np.isnan(places_m[:, :, 0])
            absent_frames = [frozenset(prepared.numbers[rows].tolist()) for rows in absent]
        floor_m = floor_height(*(motion for motion, _ in motions))  # on which everybody stands
        for (motion, ratio), (_, facts), absent_steps in zip(
            motions, tracked, absent_frames, strict=True
        ):
            motion = replace(motion, floor_m=floor_m).in_world(prepared.upright)
            facts |= {"half_turn_ratio": round(ratio, 3)} | prepared.facts
            estimates.append(Estimate(motion, stage_s, facts, rig=rig, absent_frames=absent_steps))
        return estimates


def _looked_for(people: int | None, cameras: int, given: BodyModel | None) -> int | None:
    """Number of people to look for; None: as many as are seen.

    Args:
        people: as was asked.
        cameras: their number; before two, nearly everything is a phantom.
        given: a body that is no person's.
    """
    if people in (None, 1):
        return 1 if cameras < PEOPLE_CAMERAS or given is not None else people
    if given is not None:
        raise InputError(f"{people} bodies that are no person's cannot be followed: one can")
    require_cameras(people, cameras)
    return people


def _posed_as(rig: Rig, pinholes: Rig) -> Rig:
    """A rig whose cameras stand as others do."""
    return Rig(
        tuple(
            replace(camera, rotation=other.rotation, translation=other.translation)
            for camera, other in zip(rig, pinholes, strict=True)
        )
    )


def _motion(
    tracker: PoseTracker,
    settings: Settings,
    numbers: np.ndarray,
    times: np.ndarray,
    clock: StageClock,
    reporter: Reporter,
) -> tuple[Motion, float]:
    """Poses as a motion, conditioned, with their quality, and the half-turn ratio."""
    posed = [t for t, pose in enumerate(tracker.poses) if pose is not None]
    poses = [pose for pose in tracker.poses if pose is not None]
    if not poses:
        raise InputError(
            "no body was found in any frame: look at the hull with `voxelpose carve`, and check"
            " silhouettes and calibration"
        )
    fps = tracker.fps
    root = np.stack([pose.root_m for pose in poses])
    angles = np.stack([pose.angles_rad for pose in poses])
    rotation = quaternions(np.stack([pose.root_rotation for pose in poses]))
    motion = Motion(fps, tracker.body.model, root, rotation, angles, numbers[posed], times[posed])
    motion = conditioned(motion, settings.applied_conditioning)
    reporter.stage("quality", len(posed))
    estimated = motion.select(np.flatnonzero(~motion.filled))
    arrays, ratio = motion_quality(tracker, estimated, posed, clock, reporter)
    return replace(motion, quality=quality_with_filled(motion.filled, arrays)), ratio
