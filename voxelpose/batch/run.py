"""The run of a batch: every job in whichever process is free, none stopping the others; long
recordings in pieces that overlap, estimated side by side and joined.
"""

import json
import shutil
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.storage.atomic import claimed, write_whole
from silhouette_core.estimator import Estimate
from silhouette_core.motion.motion import Motion
from silhouette_core.workers import WorkerEndedError, carry_out
from voxelpose.batch.jobs import Job
from voxelpose.evaluation import Score, evaluate, evaluate_people
from voxelpose.fitting import Output, fit_people, write_estimate
from voxelpose.recording.truth import truth_of
from voxelpose.reliability import Verdict, verdict_of, verdict_of_people
from voxelpose.results import Result, as_json, is_result, open_people, people_seconds
from voxelpose.version import __version__

PIECES = "pieces"
"""Folder beside the results in which those of the pieces are until they are joined."""
_JOB = "job.json"  # in a result's folder: the job of a batch that it was made for


def pieces_of(job: Job, piece_s: float, out: Path) -> list[Job]:
    """Jobs of a long recording's pieces; none where it is short, or has one camera. Those after the
    first keep the body that it finds. InputError where the recording cannot be used.
    """
    if job.command != "fit":
        return []
    recording = job.open()
    total, length = recording.frame_count, max(round(piece_s * recording.fps), 1)
    count = round(total / length)
    if count < 2:  # the whole is nearer to a piece than two halves are
        return []
    bounds = np.linspace(0, total, count + 1).round().astype(int)
    overlap = max(round(recording.fps / 2), 1)  # of either piece: they share a second
    pieces = []
    for number, (start, stop) in enumerate(pairwise(bounds.tolist())):
        used = recording.numbers[max(start - overlap, 0) : stop + overlap]
        settings = dict(job.settings) | {"frames": f"{used[0]}:{used[-1] + 1}"}
        if pieces and job.estimation().chosen_estimator == "multiview" and "body" not in settings:
            settings["body"] = str((out / PIECES / pieces[0].name).resolve())
        pieces.append(replace(job, name=f"{job.name}.{number:03d}", settings=settings))
    return pieces


def join_pieces(job: Job, folders: Sequence[Path], output: Output) -> Result:
    """Writes the result of a recording from those of its pieces, in their order, which are blended
    where they overlap. InputError where one is damaged, or the output cannot be used.
    """
    results = [Result.open(folder) for folder in folders]
    motion, seams_mm = joined([result.motion for result in results])
    summaries: list[Any] = [result.summary for result in results]
    spent = [summary["seconds"]["stages"] for summary in summaries]
    seconds = {
        name: np.array([float(stages.get(name, {}).get("sum", 0.0)) for stages in spent])
        for name in sorted(set().union(*spent))
    }
    facts = dict(summaries[0].get("facts", {})) | {
        "pieces": [summary["frames"]["last"] + 1 for summary in summaries],
        "seams_mm": np.round(seams_mm, 1).tolist(),
    }
    ratios = [summary["facts"].get("half_turn_ratio", np.inf) for summary in summaries]
    if np.isfinite(min(ratios)):
        facts["half_turn_ratio"] = min(ratios)
    estimate = Estimate(motion, seconds, facts, rig=results[0].rig)
    spent_s = sum(float(summary["seconds"]["total"]) for summary in summaries)
    asked = job.estimation()
    settings, estimator = asked.settings(), asked.chosen_estimator
    return write_estimate(job.open(), output, estimate, settings, estimator, spent_s)


def joined(motions: Sequence[Motion]) -> tuple[Motion, list[float]]:
    """Motions of pieces of one body, in the order of their frames, as one, and how far apart the
    joints are in the mean of the frames that two pieces share, mm; NaN where they share none.

    There, positions and angles pass from one to the other, linearly; the quality is that of the
    nearer one. A piece overlaps its neighbours at most.
    """
    whole, seams_mm = _join_overlapping([replace(motion, unfiltered=None) for motion in motions])
    if all(motion.unfiltered is None for motion in motions):
        return whole, seams_mm
    # A piece that has no others is as it was estimated.
    before = [replace(motion.unfiltered or motion, quality={}) for motion in motions]
    return replace(whole, unfiltered=_join_overlapping(before)[0]), seams_mm


def _join_overlapping(motions: Sequence[Motion]) -> tuple[Motion, list[float]]:
    whole, seams_mm = motions[0], list[float]()
    for after in motions[1:]:
        shared, before_rows, after_rows = np.intersect1d(
            whole.frames, after.frames, return_indices=True
        )
        first = whole.select(np.flatnonzero(~np.isin(whole.frames, shared)))
        last = after.select(np.flatnonzero(~np.isin(after.frames, shared)))
        if not len(shared):
            seams_mm.append(float("nan"))
            whole = _concatenated([first, last])
            continue
        old, new = whole.select(before_rows), after.select(after_rows)
        distance_m = np.linalg.norm(old.landmarks() - new.landmarks(), axis=2)
        seams_mm.append(1000 * float(distance_m.mean()))
        whole = _concatenated([first, _cross_faded(old, new), last])
    return whole, seams_mm


def _cross_faded(old: Motion, new: Motion) -> Motion:
    """A motion that passes over into another of the same frames."""
    weight = (np.arange(len(old)) + 1.0) / (len(old) + 1)
    column, late = weight[:, None], weight >= 0.5

    def mixed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (1 - column) * a + column * b

    names = set(old.quality) & set(new.quality)
    return replace(
        old,
        root_m=mixed(old.root_m, new.root_m),
        root_quaternion=_slerp(old.root_quaternion, new.root_quaternion, column),
        angles_rad=mixed(old.angles_rad, new.angles_rad),
        filled=old.filled & new.filled,
        quality={
            name: np.concatenate([old.quality[name][~late], new.quality[name][late]])
            for name in names
        },
    )


def _slerp(old: np.ndarray, new: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Quaternions (T, 4) a share `weight` (T, 1) of the way from some to others."""
    start, end = (Rotation.from_quat(four, scalar_first=True) for four in (old, new))
    part = Rotation.from_rotvec(weight * (start.inv() * end).as_rotvec())
    return (start * part).as_quat(canonical=True, scalar_first=True)


def _concatenated(motions: Sequence[Motion]) -> Motion:
    """Motions of different frames as one, in the order of the frames."""
    # Frames that one piece has lost lie between those of another.
    order = np.argsort(np.concatenate([motion.frames for motion in motions]))

    def chained(arrays: Iterable[np.ndarray]) -> np.ndarray:
        return np.concatenate(list(arrays))[order]

    each = ("root_m", "root_quaternion", "angles_rad", "frames", "time_s", "filled")
    quality = set.intersection(*(set(motion.quality) for motion in motions))
    return replace(
        motions[0],
        **{name: chained(getattr(motion, name) for motion in motions) for name in each},
        quality={name: chained(motion.quality[name] for motion in motions) for name in quality},
    )


Key = TypeVar("Key")


@dataclass(frozen=True)
class BatchSettings:
    """Settings of a batch."""

    out: Path
    processes: int  # jobs at a time on this machine
    # Address of a Dask scheduler whose machines work instead; None: this machine.
    cluster: str | None = None
    pictures: bool = True
    report: bool = True
    # Length of the pieces into which long recordings are divided, s; None: they are not.
    piece_s: float | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a job."""

    job: Job
    # `done`; `kept`: done by an earlier run with the same settings; `failed`.
    status: Literal["done", "kept", "failed"]
    message: str = ""  # why it failed, in a line; empty otherwise
    seconds: float = 0.0  # duration of the estimation
    # summary.json of the result; empty if it failed, and of several people.
    summary: Mapping[str, Any] = field(default_factory=dict)
    # Errors against the recording's truth; empty where there is none.
    score: Mapping[str, Any] = field(default_factory=dict)
    people: "Mapping[str, Outcome]" = field(default_factory=dict)  # of several, of each by name

    @property
    def verdict(self) -> Verdict:
        """How far the result can be relied on."""
        if self.status == "failed":
            return Verdict("failed", self.message)
        if self.people:
            return verdict_of_people({name: one.verdict for name, one in self.people.items()})
        return verdict_of(self.summary)


@dataclass(frozen=True)
class _Task:
    """A job for a worker; of a long recording, with the results of its pieces, to be joined."""

    job: Job
    settings: BatchSettings
    pieces: tuple[Path, ...] = ()

    @property
    def folder(self) -> Path:
        return self.settings.out / self.job.name

    @property
    def identity(self) -> Any:
        """What a result must have been made from to be kept."""
        job = replace(self.job, sources={})  # wherever they come from
        return json.loads(as_json({"voxelpose": __version__, **asdict(job)}))

    @property
    def is_done(self) -> bool:
        try:
            made = json.loads((self.folder / _JOB).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return False
        return is_result(self.folder) and made == self.identity

    def outcome(self, status: Literal["done", "kept"], seconds: float | None = None) -> Outcome:
        results, scores = open_people(self.folder), dict[str, Score]()
        several, summary = len(results) > 1, dict[str, Any](results[0].summary)
        if (truth := truth_of(Path(self.job.recording))) is not None:
            # A truth that does not fit is no reason to fail.
            with suppress(InputError, ValueError):
                if several:
                    scores = evaluate_people(self.folder, truth)
                else:
                    scores = {self.folder.name: evaluate(self.folder, truth)}
        if seconds is None:
            spent = people_seconds(self.folder) if several else summary["seconds"]
            seconds = float(spent["total"])
        each: dict[str, Outcome] = {}
        for result in results:
            name = result.folder.name
            score = asdict(scores[name]) if scores else {}
            each[name] = Outcome(self.job, status, "", seconds, result.summary, score)
        if several:
            return Outcome(self.job, status, "", seconds, people=each)
        return each[results[0].folder.name]


def run_batch(
    jobs: Sequence[Job], settings: BatchSettings, on_outcome: Callable[[Outcome, int | None], None]
) -> list[Outcome]:
    """Runs the jobs that are not done yet; returns an outcome for each job, in their order.
    InputError where there is no worker, the folder cannot be made, or another batch is writing it.

    Results are whole or not there; run again, a batch does what is missing, what failed and what
    has other settings now. `on_outcome` is called with every outcome, and how many there are so
    far; None for a piece of a long recording.
    """
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{settings.out} cannot be made: {error.strerror or error}") from error
    with claimed(settings.out.resolve()):
        return _run_jobs(jobs, settings, on_outcome)


def _run_jobs(
    jobs: Sequence[Job], settings: BatchSettings, on_outcome: Callable[[Outcome, int | None], None]
) -> list[Outcome]:
    outcomes: dict[int, Outcome] = {}

    def keep(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        on_outcome(outcome, len(outcomes))

    for number, job in enumerate(jobs):
        task = _Task(job, settings)
        if task.is_done:
            keep(number, task.outcome("kept"))
    todo = [number for number in range(len(jobs)) if number not in outcomes]
    divided = {number: _pieces(jobs[number], settings) for number in todo}
    long = [number for number in todo if divided[number]]
    of_piece = replace(settings, out=settings.out / PIECES, pictures=False, report=False)

    def keep_piece(key: tuple[int, int], outcome: Outcome) -> None:
        on_outcome(outcome, None)
        number, place = key
        if outcome.people:
            words = f"{len(outcome.people)} people are seen, and pieces follow one: set people = 1"
            outcome = Outcome(outcome.job, "failed", f"{words}, or leave out --pieces")
        if outcome.status == "failed":
            words = f"piece {place + 1} of {len(divided[number])}: {outcome.message}"
            keep(number, Outcome(jobs[number], "failed", words))

    def run_pieces(keys: list[tuple[int, int]]) -> None:
        tasks: dict[tuple[int, int], _Task] = {}
        for number, place in keys:
            task = _Task(divided[number][place], of_piece)
            if number not in outcomes and task.is_done:
                keep_piece((number, place), task.outcome("kept"))
            elif number not in outcomes:
                tasks[number, place] = task
        _carry_out(tasks, settings, keep_piece)

    # The others take the first piece's body.
    run_pieces([(number, 0) for number in long])
    run_pieces([(number, k) for number in long for k in range(1, len(divided[number]))])
    tasks = {
        number: _Task(
            jobs[number], settings, tuple(of_piece.out / piece.name for piece in divided[number])
        )
        for number in sorted(todo, key=lambda number: number in long)
        if number not in outcomes
    }
    _carry_out(tasks, settings, keep)
    with suppress(OSError):  # pieces of a recording that failed are kept
        of_piece.out.rmdir()
    return [outcomes[number] for number in range(len(jobs))]


def _pieces(job: Job, settings: BatchSettings) -> list[Job]:
    if settings.piece_s is None:
        return []
    try:
        return pieces_of(job, settings.piece_s, settings.out)
    except InputError:  # told by the job itself
        return []


def _carry_out(
    tasks: dict[Key, _Task], settings: BatchSettings, keep: Callable[[Key, Outcome], None]
) -> None:
    """Carries out tasks and gives each outcome to `keep`."""
    left: dict[Key, _Task] = dict(tasks)
    suspects: list[Key] = []
    while left:
        # Tasks that were in work when one of several processes was ended are tried alone: that may
        # have been another's fault, or have happened before all had begun.
        suspects = [key for key in suspects if key in left]
        group = suspects[:1] or list(left)
        processes = min(settings.processes, len(group))
        done: list[Key] = []
        of_group = [left[key] for key in group]
        try:
            with closing(carry_out(_run_task, of_group, processes, settings.cluster)) as results:
                for number, outcome in results:
                    keep(group[number], outcome)
                    done.append(group[number])
        except WorkerEndedError as error:
            ended = [group[number] for number in error.tasks]
            if len(group) == 1:
                keep(ended[0], Outcome(left[ended[0]].job, "failed", str(error)))
                done.append(ended[0])
            else:
                suspects = ended
        left = {key: task for key, task in left.items() if key not in done}


def _run_task(task: _Task) -> Outcome:
    """Carries out one job; what the user can correct is an outcome, a bug is raised."""
    job, settings, started = task.job, task.settings, time.perf_counter()
    # Alone, a job has all threads; several share the cores, one each.
    threads = None if settings.processes == 1 and settings.cluster is None else 1
    try:
        output = Output(task.folder, is_result(task.folder), settings.pictures, job.sources)
        if task.pieces:
            join_pieces(job, task.pieces, output)
        else:
            asked = replace(job.estimation(), threads=threads)
            estimator, people = asked.chosen_estimator, asked.people_wanted()
            fit_people(job.open(), output, asked.settings(), estimator, people=people)
        if settings.report:
            from voxelpose.report.page import write_report  # its charts take seconds to import

            write_report(task.folder)
        write_whole(task.folder / _JOB, as_json(task.identity))
        for folder in task.pieces:
            shutil.rmtree(folder, ignore_errors=True)
    except InputError as error:
        seconds = time.perf_counter() - started
        return Outcome(job, "failed", " ".join(str(error).split()), seconds)
    return task.outcome("done", time.perf_counter() - started)
