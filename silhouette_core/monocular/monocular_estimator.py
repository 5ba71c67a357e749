"""Monocular estimator: motion from the silhouettes of one camera."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from calib.moments import even_moments
from calib.upright import Z_UP, UprightFrame, axis_name, up_from_cameras
from silhouette_core.estimator import Estimate, FrameSource, Settings, read_options
from silhouette_core.image.plausibility import MOMENTS, check_plausible
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.jit import fewer_threads, set_threads
from silhouette_core.monocular.body_library import (
    body_of_track,
    library_of_body,
    some_silhouettes,
)
from silhouette_core.monocular.joined_person import JoinedPerson, Sample
from silhouette_core.monocular.monocular_stages import (
    LONG_SIDE_PX,
    MonocularOptions,
    MonocularStages,
    library_for,
)
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.hypothesis_store import COUNT, HypothesisStore
from silhouette_core.monocular.tracking.joint_error import hypothesis_spread, joint_errors
from silhouette_core.monocular.tracking.trajectory import FrameEstimate, PoseTrajectory
from silhouette_core.monocular.tree.forward import FilterFrame
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import read_ahead
from silhouette_core.scoring.backend import load_backend

_BLOCK = 150  # frames copied into arrays together


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
        options = read_options(MonocularOptions, settings.options, "monocular")
        if len(source.rig) != 1:
            raise InputError(
                f"{len(source.rig)} cameras are too many for the monocular estimator: choose one"
                " with --camera NAME"
            )
        set_threads(settings.threads)
        known = body_of_track(options.body, options.library, reporter) or library_for(
            options, settings, reporter
        )
        frame = upright_frame(source.rig, settings, reporter)
        camera = frame.rig(source.rig).cameras[0]
        reporter.stage("background")
        silhouettes = Silhouettes(source, settings.background, LONG_SIDE_PX, ahead=settings.smooth)
        silhouettes.note(reporter)
        if silhouettes.unknown:
            reporter.note("with one camera, what is marked as unknown counts as background")
        samples = (
            _plausible_samples(source, silhouettes)
            if settings.smooth or source.silhouettes_given
            else []
        )
        library, root = (
            (known, None)
            if isinstance(known, PoseLibrary)
            else library_of_body(
                known,
                options.library,
                some_silhouettes(source, silhouettes, camera, LONG_SIDE_PX),
                load_backend(settings.backend),
                reporter,
            )
        )
        reporter.stage("motion model")
        clock, counts, hypotheses = StageClock(), _Counts(), HypothesisStore(frame)
        pictures, interval_s = not source.silhouettes_given, 1 / source.fps
        stages = MonocularStages(
            library, camera, settings, options, interval_s, pictures, clock, root
        )
        joined = settings.smooth and library.model.person is not None
        joining = _joining(source, silhouettes, samples, reporter) if joined else None
        people = _people(source, silhouettes, joining, stages)
        if settings.smooth:  # otherwise the hypotheses need the other core
            people = read_ahead(people)
        filter_frames = read_ahead(_filter_frames(people, stages), 1)

        def estimates() -> Iterator[FrameEstimate]:
            reporter.stage("tracking", source.frame_count)
            for number, filter_frame in filter_frames:
                if filter_frame is None:
                    counts.absent.append(number)
                else:
                    counts.add(filter_frame)
                    yield from stages.estimates(filter_frame)
                reporter.advance()
            reporter.stage("last frames")
            yield from stages.trajectory.finish()

        with nullcontext() if settings.smooth else fewer_threads():
            motion = _motion(
                estimates(),
                stages.trajectory,
                hypotheses,
                source.fps,
                settings.applied_conditioning,
            )
        if motion is None:
            raise InputError(
                f"camera {source.rig.names[0]} shows nobody in any frame: check its background, and"
                " that somebody moves before it"
            )
        facts = _facts(library, options, settings, counts, stages.coloured)
        return Estimate(
            motion.in_world(frame),
            {stage: np.array(seconds) for stage, seconds in clock.seconds.items()},
            facts,
            hypotheses,
        )


def _plausible_samples(source: FrameSource, silhouettes: Silhouettes) -> list[Sample]:
    """Some frames of the only camera and their silhouettes.

    Raises:
        InputError: these cannot be those of a person.
    """
    steps, name = even_moments(source.frame_count, MOMENTS).tolist(), source.rig.names[0]
    samples = [Sample(frames, silhouettes.of(frames)[name]) for frames in source.at(steps)]
    check_plausible({name: [sample.mask for sample in samples]}, least=1)
    return samples


def _joining(
    source: FrameSource, silhouettes: Silhouettes, samples: Sequence[Sample], reporter: Reporter
) -> JoinedPerson | None:
    """What joins the pieces of silhouettes, told in a note; None where they are whole."""
    joining = JoinedPerson.learned(silhouettes, source.rig.names[0], samples)
    if joining is not None:
        reporter.note(
            "the silhouette is in pieces, as before a floor or wall of the clothes' colours: they"
            " are joined where the pictures differ from the background between them"
        )
    return joining


def upright_frame(rig: Rig, settings: Settings, reporter: Reporter) -> UprightFrame:
    """The frame with z up as the settings state it, else as the camera alone tells."""
    up = up_from_cameras(rig) if settings.up is None else settings.up
    if settings.up is None and not np.array_equal(up, Z_UP):
        reporter.note(
            f"up is {axis_name(up)} of the calibration's world, by how the camera stands (--up z"
            " keeps z; results stay in that world, exports are upright)"
        )
    return UprightFrame.from_up(up)


def _people(
    source: FrameSource,
    silhouettes: Silhouettes,
    joining: JoinedPerson | None,
    stages: MonocularStages,
) -> Iterator[tuple[int, float, Person | None]]:
    """Number and time of every frame, and the person in it."""
    name = source.rig.names[0]
    for number, seconds, frames in source:
        with stages.clock("silhouettes"):
            mask = silhouettes.of(frames)[name] if joining is None else joining.of(frames)
            person = stages.person(frames[name], mask)
        yield number, seconds, person


def _filter_frames(
    people: Iterable[tuple[int, float, Person | None]], stages: MonocularStages
) -> Iterator[tuple[int, FilterFrame | None]]:
    """Number of every frame, and its posterior if it shows a person."""
    for number, seconds, person in people:
        yield number, None if person is None else stages.posterior(number, seconds, person)


def _motion(
    estimates: Iterable[FrameEstimate],
    trajectory: PoseTrajectory,
    hypotheses: HypothesisStore,
    fps: float,
    conditioning: Conditioning,
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
    agreement = np.clip(1 - whole["error"], 0.0, 1.0)
    quality = {
        "outline_agreement": agreement,
        "landmark_confidence": (
            agreement[:, None] * np.where(occluded[:, trajectory.model.landmark_part], 0.3, 1.0)
        ),
        "occluded": occluded,
        "cut": whole["cut"],
        "lost": whole["lost"],
    }
    if trajectory.finder is not None:  # without a proposal they were not compared with the truth
        hidden = occluded[:, trajectory.model.landmark_part]
        errors = joint_errors(whole["spread"], agreement, hidden)
        quality |= {
            "pose_probability": whole["probability"],
            "pose_error_mm": errors.pose_mm,
            "joint_error_mm": errors.joint_mm,
            "landmark_confidence": errors.near_probability,
        }
    motion = Motion(
        fps, trajectory.model, root, rotation, angles, numbers, whole["time_s"], quality
    )
    return conditioned(motion, conditioning)


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
        "probability": np.array([frame.probability.max() for frame in frames]),
        "spread": np.stack(
            [hypothesis_spread(frame.probability[:COUNT], frame.joints[:COUNT]) for frame in frames]
        ),
        "occluded": np.stack([frame.occluded for frame in frames]),
        "cut": np.array([frame.cut for frame in frames]),
        "lost": np.array([frame.lost for frame in frames]),
    }


def _facts(
    library: PoseLibrary,
    options: MonocularOptions,
    settings: Settings,
    counts: _Counts,
    coloured: bool,
) -> dict[str, object]:
    return {
        "stature_given": settings.stature_m is not None,
        "colours": coloured,
        "library": {
            "file": options.library or ("default" if library.model.person else "sampled"),
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
