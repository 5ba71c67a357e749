"""Monocular estimator: motion from the silhouettes of one camera."""

from array import array
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from calib.camera import Camera, Rig
from calib.checks import BoolArray, Float32Array, FloatArray
from calib.errors import InputError
from calib.storage.temporary import ScratchFile
from calib.upright import Z_UP, UprightFrame, axis_name, up_from_cameras
from silhouette_core.estimator import (
    ONE_PERSONS,
    Estimate,
    Frame,
    FrameSource,
    Settings,
    read_options,
)
from silhouette_core.image.plausibility import check_plausible, telling_frames
from silhouette_core.image.seen_people import people_seen
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.jit import fewer_threads, set_threads
from silhouette_core.monocular.body_library import body_of_track, library_of_body, some_silhouettes
from silhouette_core.monocular.monocular_stages import (
    MonocularOptions,
    PoseStages,
    TrackedPerson,
    person_for,
)
from silhouette_core.monocular.person import Person, find_person
from silhouette_core.monocular.person_finder import (
    LONG_SIDE_PX,
    OneOfPeople,
    PersonFinder,
    people_apart,
)
from silhouette_core.monocular.tracking.joint_error import hypothesis_spread, joint_errors
from silhouette_core.monocular.tracking.trajectory import (
    FrameEstimate,
    PendingFrame,
    PoseTrajectory,
)
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import read_ahead
from silhouette_core.scoring.backend import load_backend

_BLOCK = 150  # frames copied into arrays together
_COUNT = 5  # hypotheses that are stored of a frame, at most


class MonocularEstimator:
    """Estimates motion from one camera, of a person, or of several whose silhouettes stay apart.

    A person is followed by what the learned proposal expects, other bodies by the samples of paper
    A's tree; see docs/papers.md.
    """

    name = "monocular"
    takes_body = True

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        return self.estimate_people(source, settings, reporter, 1)[0]

    def estimate_people(
        self, source: FrameSource, settings: Settings, reporter: Reporter, people: int | None
    ) -> list[Estimate]:
        """See `silhouette_core.estimator.PeopleEstimator.estimate_people`; None: one person."""
        options = read_options(MonocularOptions, settings.options, "monocular")
        set_threads(settings.threads)
        frame, count = upright_frame(source.rig, settings, reporter), people or 1
        if count > 1:
            if settings != settings.of_anybody:
                reporter.note(ONE_PERSONS)
            settings, options = settings.of_anybody, replace(options, body="")
        known = body_of_track(options.body, options.library, reporter) or person_for(
            options, settings, reporter
        )
        camera = frame.rig(source.rig).cameras[0]
        silhouettes = _silhouettes(source, settings, reporter)
        if settings.smooth or source.silhouettes_given:
            check_person(source, silhouettes, isinstance(known, TrackedPerson))
        tracked, root = (
            (known, None)
            if isinstance(known, TrackedPerson)
            else library_of_body(
                known,
                options.library,
                some_silhouettes(source, silhouettes, camera),
                load_backend(settings.backend),
                reporter,
            )
        )
        reporter.stage("motion model")
        work = _Tracking(source, settings, options, silhouettes, frame, (tracked, root), reporter)
        if count == 1:
            return [work.estimate(PersonFinder(camera, work.coloured))]
        finders = work.finders(count)
        estimates = [work.estimate(finder) for finder in finders]
        merged = max(finder.merged for finder in finders)
        if merged:
            reporter.note(
                f"people have one silhouette in {merged} of {source.frame_count} frames: "
                + (
                    "nobody who is in it has a pose there"
                    if silhouettes.people is None
                    else "the pose network tells whose each part is"
                )
            )
        return estimates


@dataclass(frozen=True, eq=False)
class _Tracking:
    """Tracking of people before one camera; `tracked` is whom, or a library of another body, and
    the place of its root, if that stands still.
    """

    source: FrameSource
    settings: Settings
    options: MonocularOptions
    silhouettes: Silhouettes
    frame: UprightFrame
    tracked: tuple[TrackedPerson | PoseLibrary, Pose | None]
    reporter: Reporter

    @property
    def camera(self) -> Camera:
        """The camera, in the upright frame."""
        return self.frame.rig(self.source.rig).cameras[0]

    @property
    def coloured(self) -> bool:
        """Whether what lies inside of outlines is used."""
        plain = self.source.silhouettes_given or self.options.outline_only
        return isinstance(self.tracked[0], TrackedPerson) and not plain

    def finders(self, count: int) -> list[OneOfPeople]:
        """Finders of so many people, who are looked for in the whole recording. Raises InputError
        where fewer are seen apart.
        """
        source, name = self.source, self.source.rig.names[0]
        self.reporter.stage("people", source.frame_count)

        def seen() -> Iterator[tuple[Frame, BoolArray, list[BoolArray]]]:
            for step, (_, _, frames) in enumerate(source):
                mask = self.silhouettes.of(frames, step=step)[name]
                yield frames[name], mask, self.silhouettes.of_people(name, step)
                self.reporter.advance()

        coloured = not source.silhouettes_given
        people = people_apart(read_ahead(seen()), self.camera, count, coloured)
        if len(people) < count:
            seen_apart = "nobody is" if not people else f"{len(people)} at most are"
            raise InputError(
                f"{count} people were asked for, and {seen_apart} seen apart by camera {name}: give"
                f" --people {max(len(people), 1)}, or look at the silhouettes with `voxelpose"
                " setup`"
            )
        return [OneOfPeople(self.camera, self.coloured, people, number) for number in range(count)]

    def estimate(self, finder: PersonFinder) -> Estimate:
        """Estimate of the person that is found. Raises InputError where nobody is found in any
        frame.
        """
        source, settings, options = self.source, self.settings, self.options
        tracked, root = self.tracked
        clock, hypotheses, absent = StageClock(), HypothesisStore(self.frame), list[int]()
        stages = PoseStages(tracked, self.camera, settings, options, clock, root)
        absent_frames: set[int] = set()
        people = read_ahead(_people(source, self.silhouettes, finder, clock, absent_frames))
        frames = (
            (number, None if person is None else stages.noted(number, seconds, person))
            for number, seconds, person in people
        )
        if settings.smooth:  # otherwise a frame needs what was found in the last
            frames = read_ahead(frames)
        estimates = _estimates(frames, stages, absent, source.frame_count, self.reporter)
        with nullcontext() if settings.smooth else fewer_threads():
            motion = _motion(
                estimates, stages.trajectory, hypotheses, source.fps, settings.applied_conditioning
            )
        if motion is None:
            raise InputError(
                f"camera {source.rig.names[0]} shows nobody in any frame: check its silhouettes,"
                " and that somebody moves before it"
            )
        facts = _facts(tracked, options, settings, motion, absent)
        silhouettes = self.silhouettes
        facts |= {"colours": self.coloured, "by_texture": silhouettes.by_texture}
        facts |= {"moving_cameras": silhouettes.moving, "network": silhouettes.network}
        if isinstance(finder, OneOfPeople):
            facts["frames_merged"] = finder.merged
        return Estimate(
            motion.in_world(self.frame),
            {stage: np.array(seconds) for stage, seconds in clock.seconds.items()},
            facts,
            hypotheses,
            absent_frames=frozenset(absent_frames),
        )


class HypothesisStore:
    """Likeliest poses of all frames, in a temporary file, so that memory does not grow with time.

    Args:
        upright: the frame in which joints are given; they are stored in the world.
    """

    def __init__(self, upright: UprightFrame) -> None:
        self._upright = upright
        self._file = ScratchFile()
        self._frames, self._counts = array("q"), array("q")
        self._joints = 0

    def put(self, frame: int, probability: FloatArray, joints_m: FloatArray) -> None:
        """Stores a frame's n hypotheses: probabilities (n,) and joints (n, L, 3), m."""
        joints_m = self._upright.world_points(joints_m)
        self._joints = joints_m.shape[1]
        rows = np.concatenate(
            [probability[:, None], joints_m.reshape(len(probability), -1)], axis=1
        )
        self._file.append(rows.astype(np.float32).tobytes())
        self._frames.append(frame)
        self._counts.append(len(rows))

    def __iter__(self) -> Iterator[tuple[int, Float32Array, Float32Array]]:
        """Yields frame number, probabilities (n,) and joints (n, L, 3), world, m."""
        start, width = 0, 1 + 3 * self._joints
        for frame, count in zip(self._frames, self._counts, strict=True):
            size = count * width * 4
            rows = np.frombuffer(self._file.read_at(start, size), np.float32).reshape(count, width)
            start += size
            yield frame, rows[:, 0], rows[:, 1:].reshape(count, self._joints, 3)


def _silhouettes(source: FrameSource, settings: Settings, reporter: Reporter) -> Silhouettes:
    """Silhouettes of the only camera; what is missing or marked is told in notes."""
    reporter.stage("masks" if source.silhouettes_given else "background")
    silhouettes = Silhouettes(
        source,
        settings.background,
        LONG_SIDE_PX,
        ahead=settings.smooth,
        people=people_seen(source, settings, reporter),
    )
    silhouettes.note(reporter)
    if silhouettes.unknown:
        reporter.note("with one camera, what is marked as unknown counts as background")
    return silhouettes


def check_person(source: FrameSource, silhouettes: Silhouettes, person: bool) -> None:
    """Refuses silhouettes of the only camera that cannot be a person's, or another body's."""
    steps, name = telling_frames(source.frame_count), source.rig.names[0]
    masks = [
        silhouettes.of(frames, step=step)[name]
        for step, frames in zip(steps, source.at(steps), strict=True)
    ]
    given = source.silhouettes_given
    check_plausible({name: masks}, least=1, person=person, given=given)


def upright_frame(rig: Rig, settings: Settings, reporter: Reporter) -> UprightFrame:
    """The frame with z up as the settings state it, else as the camera alone tells. InputError
    where there are several.
    """
    if len(rig) != 1:
        raise InputError(
            f"{len(rig)} cameras are too many for an estimator of one: choose one with --camera"
            " NAME"
        )
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
    finder: PersonFinder,
    clock: StageClock,
    absent: set[int],
) -> Iterator[tuple[int, float, Person | None]]:
    """Number and time of every frame, and the person in it; the numbers of those in which nobody is
    seen are added to `absent`.
    """
    name = source.rig.names[0]
    for step, (number, seconds, frames) in enumerate(source):
        with clock("silhouettes"):
            person, nobody = person_in(frames[name], name, step, silhouettes, finder)
        if nobody:
            absent.add(number)
        yield number, seconds, person


def person_in(
    frame: Frame, name: str, step: int, silhouettes: Silhouettes, finder: PersonFinder
) -> tuple[Person | None, bool]:
    """The person in a camera's next frame, and whether nobody is seen there at all."""
    mask = silhouettes.of({name: frame}, step=step)[name]
    person = finder.find(frame, mask, silhouettes.of_people(name, step))
    if person is None:
        return None, silhouettes.shows_nobody(name, step) and find_person(mask) is None
    return replace(person, joints=silhouettes.joints(name, step, person.mask)), False


def _estimates(
    frames: Iterable[tuple[int, PendingFrame | None]],
    stages: PoseStages,
    absent: list[int],
    count: int,
    reporter: Reporter,
) -> Iterator[FrameEstimate]:
    """Estimates of all frames that show a person; the numbers of the others are added to absent."""
    reporter.stage("tracking", count)
    for number, noted in frames:
        if noted is None:
            absent.append(number)
        else:
            yield from stages.trajectory.add(noted)
        reporter.advance()
    reporter.stage("last frames")
    yield from stages.trajectory.finish()


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
            count = min(_COUNT, len(frame.probability))
            hypotheses.put(frame.number, frame.probability[:count], frame.joints[:count])
        blocks.append(_stacked(block))
    if not blocks:
        return None
    whole = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    root, rotation, angles, numbers, occluded = (
        whole[name] for name in ("root", "rotation", "angles", "number", "occluded")
    )
    agreement = np.clip(1 - whole["error"], 0.0, 1.0)
    hidden = occluded[:, trajectory.model.tree.landmark_part]
    quality = {
        "outline_agreement": agreement,
        "landmark_confidence": agreement[:, None] * np.where(hidden, 0.3, 1.0),
        **{name: whole[name] for name in ("occluded", "cut", "lost")},
    }
    if trajectory.model.person is not None:  # others were not compared with the truth
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
    poses = PoseArrays.from_poses([frame.pose for frame in frames])
    plain = "number", "time_s", "error", "occluded", "cut", "lost"
    return {name: np.array([getattr(frame, name) for frame in frames]) for name in plain} | {
        "root": poses.root_m,
        "rotation": quaternions(poses.root_rotation),
        "angles": poses.angles_rad,
        "probability": np.array([frame.probability.max() for frame in frames]),
        "spread": np.stack(
            [hypothesis_spread(one.probability[:_COUNT], one.joints[:_COUNT]) for one in frames]
        ),
    }


def _facts(
    tracked: TrackedPerson | PoseLibrary,
    options: MonocularOptions,
    settings: Settings,
    motion: Motion,
    absent: list[int],
) -> dict[str, object]:
    person = isinstance(tracked, TrackedPerson)
    library = {"file": options.library or ("the program's proposal" if person else "sampled")}
    return {
        "stature_given": settings.stature_m is not None,
        "library": library if person else library | {"samples": len(tracked)},
        "frames_absent": absent,
        "frames_cut_by_the_border": motion.frames[motion.quality["cut"].astype(bool)].tolist(),
        "frames_lost": motion.frames[motion.quality["lost"].astype(bool)].tolist(),
    }
