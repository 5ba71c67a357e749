"""Monocular estimator: motion from the silhouettes of one camera."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Estimate, Frame, FrameSource, Settings, read_options
from silhouette_core.filter.forward import FilterFrame, ForwardFilter
from silhouette_core.filter.hypothesis_store import COUNT, HypothesisStore
from silhouette_core.filter.hypothesis_tracker import TrackerSettings
from silhouette_core.filter.person import Person, find_person
from silhouette_core.filter.trajectory import FrameEstimate, PoseTrajectory
from silhouette_core.filter.view_tree_filter import tree_filter
from silhouette_core.image.distance import WEIGHTINGS, Weighting
from silhouette_core.image.head_colours import ColourCrop
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.jit import fewer_threads, set_threads
from silhouette_core.library.default import default_library
from silhouette_core.library.pose_library import PoseLibrary, require_body
from silhouette_core.library.store import read_library
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.smoothing import smooth_runs
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import read_ahead
from silhouette_core.scoring.backend import load_backend

_LONG_SIDE_PX = 960
_USUAL_STATURE_M = 1.70
_BLOCK = 150  # frames copied into arrays together


@dataclass(frozen=True)
class _Options:
    """Options of this estimator only, checked.

    Attributes:
        library: path of a pose library; empty: the default library.
        start: "facing" or "any", see `ForwardFilter`.
        refine: whether limbs are resampled and poses refined.
        weighting: pixel weights of the silhouette distance.
        motion_model: "DM2" with the occlusion-aware eq. (5), "DM1" without.
        outline_only: whether what lies inside the outline is left out.
    """

    library: str = ""
    start: str = "facing"
    refine: bool = True
    weighting: Weighting = "balanced"
    motion_model: str = "DM2"
    outline_only: bool = False

    def __post_init__(self) -> None:
        for name, kind, what in (
            ("refine", bool, "true or false"),
            ("outline_only", bool, "true or false"),
            ("library", str, "the path of a file"),
        ):
            if not isinstance(getattr(self, name), kind):
                raise InputError(f"{name} {getattr(self, name)!r} must be {what}")
        for name, allowed in (
            ("start", ("facing", "any")),
            ("weighting", WEIGHTINGS),
            ("motion_model", ("DM1", "DM2")),
        ):
            value = getattr(self, name)
            if value not in allowed:
                raise InputError(f"{name} {value!r} is not known: use {' or '.join(allowed)}")


@dataclass
class _Counts:
    """Statistics of a recording.

    Attributes:
        absent: numbers of the frames without a person.
        cut: numbers of the frames whose border cuts the person.
        lost: numbers of the frames in which the filter lost the person.
        scored: numbers of nodes scored, level by level, frame by frame.
        levels: number of levels of the tree.
    """

    absent: list[int] = field(default_factory=list)
    cut: list[int] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    scored: array[int] = field(default_factory=lambda: array("q"))
    levels: int = 1

    def add(self, filter_frame: FilterFrame) -> None:
        if filter_frame.person.cut:
            self.cut.append(filter_frame.number)
        if filter_frame.lost:
            self.lost.append(filter_frame.number)
        self.scored.extend(filter_frame.posterior.scored)
        self.levels = len(filter_frame.posterior.scored)


class MonocularEstimator:
    """Estimates motion from one camera.

    Source: Okada and Stenger; the window, the resampling of limbs and the refinement go beyond the
    paper, see docs/papers.md.
    """

    name = "monocular"

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        options = read_options(_Options, settings.options, "monocular")
        if len(source.rig) != 1:
            raise InputError(
                f"{len(source.rig)} cameras are too many for the monocular estimator: choose one"
                " with --camera NAME"
            )
        set_threads(settings.threads)
        library = _library(options, settings, reporter)
        lens = UndistortedView.from_camera(source.rig.cameras[0], _LONG_SIDE_PX)
        reporter.stage("motion model")
        tree = tree_filter(
            library,
            options.motion_model == "DM2",
            interval_s=1 / source.fps,
            backend=load_backend(settings.backend),
        )
        clock, counts, hypotheses = StageClock(), _Counts(), HypothesisStore()
        facing = options.start == "facing"
        proposed = options.refine and library.proposal is not None
        coloured = proposed and not (options.outline_only or source.silhouettes_given)
        forward = ForwardFilter(
            tree,
            lens.pinhole,
            facing,
            options.weighting,
            interval_s=1 / source.fps,
            corrected=proposed,
        )
        tracking = TrackerSettings(options.refine, options.weighting, facing)
        if proposed and not settings.smooth:
            tracking = tracking.coarser()
        trajectory = PoseTrajectory(
            tree, lens.pinhole, tracking, settings.smooth, clock, _sexes(settings)
        )

        reporter.stage("background")
        silhouettes = Silhouettes(source, settings.background, _LONG_SIDE_PX)
        silhouettes.note(reporter)
        people = _people(source, silhouettes, lens, clock, coloured)
        if settings.smooth:  # otherwise the hypotheses need the other core
            people = read_ahead(people)
        filter_frames = read_ahead(_filter_frames(people, forward, clock), 1)

        def estimates() -> Iterator[FrameEstimate]:
            reporter.stage("tracking", source.frame_count)
            for number, filter_frame in filter_frames:
                if filter_frame is None:
                    counts.absent.append(number)
                else:
                    counts.add(filter_frame)
                    yield from trajectory.add(filter_frame)
                    if proposed:
                        forward.correct(number, trajectory.distance_m)
                reporter.advance()
            reporter.stage("last frames")
            yield from trajectory.finish()

        with nullcontext() if settings.smooth else fewer_threads():
            motion = _motion(estimates(), trajectory, hypotheses, source.fps, settings.smooth)
        if motion is None:
            raise InputError(
                f"camera {source.rig.names[0]} shows nobody in any frame: check its background, and"
                " that somebody moves before it"
            )
        facts = _facts(library, options, settings, counts, coloured)
        return Estimate(
            motion,
            {stage: np.array(seconds) for stage, seconds in clock.seconds.items()},
            facts,
            hypotheses,
        )


def _library(options: _Options, settings: Settings, reporter: Reporter) -> PoseLibrary:
    """Library scaled to the person; its silhouettes are relative to the stature."""
    stature = settings.stature_m
    if not options.library:
        if stature is None:
            reporter.note(
                f"nobody said how tall the person is: {_USUAL_STATURE_M:.2f} m is assumed, and all"
                " lengths with it"
            )
        library = default_library(
            BodySizes(_USUAL_STATURE_M, _chest(settings, _USUAL_STATURE_M), settings.sex), reporter
        )
        return _scaled(library, stature or _USUAL_STATURE_M)
    library = read_library(Path(options.library))
    sizes = library.model.sizes
    if settings.sex != "unknown" or settings.chest_m is not None:
        require_body(
            library, BodySizes(sizes.stature_m, _chest(settings, sizes.stature_m), settings.sex)
        )
    if stature is None:
        return library
    if abs(sizes.stature_m - stature) > 0.01:
        reporter.note(f"the library's body of {sizes.stature_m:.2f} m is scaled to {stature:.2f} m")
    return _scaled(library, stature)


def _sexes(settings: Settings) -> tuple[str, ...]:
    """Templates that are tried for the person's body."""
    return ("male", "female") if settings.sex == "unknown" else (settings.sex,)


def _chest(settings: Settings, stature_m: float) -> float | None:
    """Chest girth of a body of the same proportions and another stature."""
    if settings.chest_m is None or settings.stature_m is None:
        return settings.chest_m
    return round(settings.chest_m * stature_m / settings.stature_m, 2)


def _scaled(library: PoseLibrary, stature_m: float) -> PoseLibrary:
    sizes = library.model.sizes
    factor = stature_m / sizes.stature_m
    chest = None if sizes.chest_girth_m is None else sizes.chest_girth_m * factor
    return replace(library, model=BodyModel.from_sizes(BodySizes(stature_m, chest, sizes.sex)))


def _filter_frames(
    people: Iterable[tuple[int, float, Person | None]], forward: ForwardFilter, clock: StageClock
) -> Iterator[tuple[int, FilterFrame | None]]:
    """Number of every frame, and its posterior if it shows a person."""
    for number, seconds, person in people:
        if person is None:
            yield number, None
            continue
        with clock("estimation"):
            filter_frame = forward.step(number, seconds, person)
        yield number, filter_frame


def _people(
    source: FrameSource,
    silhouettes: Silhouettes,
    lens: UndistortedView,
    clock: StageClock,
    coloured: bool,
) -> Iterator[tuple[int, float, Person | None]]:
    """Number and time of every frame, and the person in it."""
    name = source.rig.names[0]
    near_px, usual_px = None, None
    for number, seconds, frames in source:
        with clock("silhouettes"):
            person = find_person(lens.undistort(silhouettes.of(frames)[name]), near_px, usual_px)
            if coloured and person is not None:
                person = replace(person, colours=_colours(lens, frames[name], person.mask))
        if person is not None:
            moments = cv2.moments(person.mask.view(np.uint8), binaryImage=True)
            area = moments["m00"]
            usual_px = area if usual_px is None else 0.9 * usual_px + 0.1 * area
            near_px = np.array([moments["m10"], moments["m01"]]) / area
        yield number, seconds, person


def _colours(lens: UndistortedView, picture: Frame, mask: NDArray[np.bool_]) -> ColourCrop:
    """Colours in the rectangle that holds a silhouette."""
    (top, bottom), (left, right) = (
        (int(found[0]), int(found[-1]) + 1)
        for found in (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    )
    return ColourCrop.of(
        lens.undistort_part(picture, (left, top), (right - left, bottom - top)), (left, top)
    )


def _motion(
    estimates: Iterable[FrameEstimate],
    trajectory: PoseTrajectory,
    hypotheses: HypothesisStore,
    fps: float,
    smoothed: bool,
) -> Motion | None:
    """Motion of all frames, or None if there are none; their hypotheses are stored."""
    frames, blocks = iter(estimates), []
    while block := list(islice(frames, _BLOCK)):
        for frame in block:
            count = min(COUNT, len(frame.probability))
            hypotheses.put(frame.number, frame.probability[:count], frame.joints[:count])
        blocks.append(_stacked(block))
    if not blocks:
        return None
    whole = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    root, rotation, angles, numbers, occluded = (
        whole[name] for name in ("root", "rotation", "angles", "number", "occluded")
    )
    if smoothed:
        smooth_runs(root, rotation, angles, numbers, fps)
    confidence = np.clip(1 - whole["error"], 0.0, 1.0)
    quality = {
        "confidence": confidence,
        "landmark_confidence": (
            confidence[:, None] * np.where(occluded[:, trajectory.model.landmark_part], 0.3, 1.0)
        ),
        "occluded": occluded,
        "cut": whole["cut"],
        "lost": whole["lost"],
    }
    return Motion(fps, trajectory.model, root, rotation, angles, numbers, whole["time_s"], quality)


def _stacked(frames: list[FrameEstimate]) -> dict[str, np.ndarray]:
    """Arrays of frames, which keep nothing else of them in memory."""
    poses = [frame.pose for frame in frames]
    return {
        "root": np.stack([pose.root_m for pose in poses]),
        "rotation": quaternions(np.stack([pose.root_rotation for pose in poses])),
        "angles": np.stack([pose.angles_rad for pose in poses]),
        "number": np.array([frame.number for frame in frames], np.int64),
        "time_s": np.array([frame.time_s for frame in frames]),
        "error": np.array([frame.error for frame in frames]),
        "occluded": np.stack([frame.occluded for frame in frames]),
        "cut": np.array([frame.cut for frame in frames]),
        "lost": np.array([frame.lost for frame in frames]),
    }


def _facts(
    library: PoseLibrary,
    options: _Options,
    settings: Settings,
    counts: _Counts,
    coloured: bool,
) -> dict[str, object]:
    return {
        "stature_given": settings.stature_m is not None,
        "colours": coloured,
        "library": {
            "file": options.library or "default",
            "samples": len(library),
            "base_poses": len(library.base_angles),
            "nodes": [len(level) for level in library.levels],
        },
        "nodes_scored_median": [
            int(n) for n in np.median(np.array(counts.scored).reshape(-1, counts.levels), axis=0)
        ],
        "frames_absent": counts.absent,
        "frames_cut_by_the_border": counts.cut,
        "frames_lost": counts.lost,
    }
