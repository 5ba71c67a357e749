"""The run of a batch: every job in whichever process is free, none stopping the others."""

import json
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from calib.atomic import write_whole
from calib.atomic_folder import claimed
from calib.errors import InputError
from silhouette_core.workers import WorkerEndedError, open_workers
from voxelpose.batch.jobs import Job
from voxelpose.batch.pieces import PIECES, join_pieces, pieces_of
from voxelpose.evaluation import evaluate
from voxelpose.fitting import Output, fit
from voxelpose.recording.truth import truth_of
from voxelpose.reliability import Verdict, verdict_of
from voxelpose.report.page import write_report
from voxelpose.results import Result, as_json, is_result
from voxelpose.version import __version__

Key = TypeVar("Key")
_JOB = "job.json"  # in a result's folder: the job of a batch that it was made for


@dataclass(frozen=True)
class BatchSettings:
    """Settings of a batch.

    Attributes:
        processes: jobs at a time on this machine.
        cluster: address of a Dask scheduler whose machines work instead; None: this machine.
        piece_s: length of the pieces into which long recordings are divided, s; None: they are not.
    """

    out: Path
    processes: int
    cluster: str | None = None
    pictures: bool = True
    report: bool = True
    piece_s: float | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a job.

    Attributes:
        status: `done`; `kept`: done by an earlier run with the same settings; `failed`.
        message: why it failed, in a line; empty otherwise.
        seconds: duration of the estimation.
        summary: summary.json of the result; empty if it failed.
        score: errors against the recording's truth; empty where there is none.
    """

    job: Job
    status: Literal["done", "kept", "failed"]
    message: str = ""
    seconds: float = 0.0
    summary: Mapping[str, Any] = field(default_factory=dict)
    score: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """How far the result can be relied on."""
        if self.status == "failed":
            return Verdict("failed", self.message)
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
        summary: Any = Result.open(self.folder).summary
        score: Mapping[str, Any] = {}
        if (truth := truth_of(Path(self.job.recording))) is not None:
            # A truth that does not fit is no reason to fail.
            with suppress(InputError, ValueError):
                score = asdict(evaluate(self.folder, truth))
        total = float(summary["seconds"]["total"]) if seconds is None else seconds
        return Outcome(self.job, status, "", total, summary, score)


def run_batch(
    jobs: Sequence[Job], settings: BatchSettings, told: Callable[[Outcome, int | None], None]
) -> list[Outcome]:
    """Runs the jobs that are not done yet; returns an outcome for each job, in their order.

    Results are whole or not there; run again, a batch does what is missing, what failed and what
    has other settings now.

    Args:
        told: told every outcome, and how many there are so far; None for a piece of a long
            recording.

    Raises:
        InputError: there is no worker, the folder cannot be made, or another batch is writing it.
    """
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{settings.out} cannot be made: {error.strerror or error}") from error
    with claimed(settings.out.resolve()):
        return _run_jobs(jobs, settings, told)


def _run_jobs(
    jobs: Sequence[Job], settings: BatchSettings, told: Callable[[Outcome, int | None], None]
) -> list[Outcome]:
    """The outcomes of the jobs, in their order."""
    outcomes: dict[int, Outcome] = {}

    def keep(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        told(outcome, len(outcomes))

    for number, job in enumerate(jobs):
        task = _Task(job, settings)
        if task.is_done:
            keep(number, task.outcome("kept"))
    todo = [number for number in range(len(jobs)) if number not in outcomes]
    divided = {number: _pieces(jobs[number], settings) for number in todo}
    long = [number for number in todo if divided[number]]
    of_piece = replace(settings, out=settings.out / PIECES, pictures=False, report=False)

    def keep_piece(key: tuple[int, int], outcome: Outcome) -> None:
        told(outcome, None)
        number, place = key
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
        try:
            with open_workers(processes, settings.cluster, 1, apart=True) as workers:
                for number, outcome in workers.run(_run_task, [left[key] for key in group]):
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
            fit(job.open(), output, job.estimator_settings(threads), job.estimator)
        if settings.report:
            write_report(task.folder)
        write_whole(task.folder / _JOB, as_json(task.identity))
        for folder in task.pieces:
            shutil.rmtree(folder, ignore_errors=True)
    except InputError as error:
        seconds = time.perf_counter() - started
        return Outcome(job, "failed", " ".join(str(error).split()), seconds)
    return task.outcome("done", time.perf_counter() - started)
