"""The run of a batch: every job in whichever process is free, none stopping the others."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from calib.errors import InputError
from silhouette_core.workers import WorkerEndedError, open_workers
from voxelpose.atomic import replacing
from voxelpose.batch.jobs import Job
from voxelpose.evaluation import TRUTH, evaluate
from voxelpose.fitting import Output, fit
from voxelpose.report.page import write_report
from voxelpose.results import Result, as_json, is_result
from voxelpose.version import __version__

JOB = "job.json"
"""File in a result's folder that says for which job of a batch it was made."""


@dataclass(frozen=True)
class BatchSettings:
    """Settings of a batch.

    Attributes:
        out: folder of the results.
        processes: jobs at a time on this machine.
        cluster: address of a Dask scheduler whose machines work instead; None: this machine.
        pictures: whether overlays and contact sheets are drawn.
        report: whether report.html is written for each.
    """

    out: Path
    processes: int
    cluster: str | None = None
    pictures: bool = True
    report: bool = True


@dataclass(frozen=True)
class Outcome:
    """What came of a job.

    Attributes:
        job: the job.
        status: `done`; `kept`: done by an earlier run with the same settings; `failed`.
        message: why it failed, in a line; empty otherwise.
        seconds: duration of the estimation.
        summary: summary.json of the result; empty if it failed.
        score: errors against truth.json; empty where there is none.
    """

    job: Job
    status: Literal["done", "kept", "failed"]
    message: str = ""
    seconds: float = 0.0
    summary: Mapping[str, Any] = field(default_factory=dict)
    score: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Task:
    """A job and where its result goes, as given to a worker."""

    job: Job
    out: Path
    pictures: bool
    report: bool
    threads: int | None


def run_batch(
    jobs: Sequence[Job], settings: BatchSettings, told: Callable[[Outcome, int], None]
) -> list[Outcome]:
    """Runs the jobs that are not done yet.

    Results are whole or not there; run again, a batch does what is missing, what failed and what
    has other settings now.

    Args:
        jobs: the jobs.
        settings: where, and by whom.
        told: told every outcome, and how many there are so far.

    Returns:
        An outcome for each job, in their order.

    Raises:
        InputError: there is no worker, or the folder cannot be made.
    """
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{settings.out} cannot be made: {error.strerror or error}") from error
    outcomes: dict[int, Outcome] = {}

    def keep(number: int, outcome: Outcome) -> None:
        outcomes[number] = outcome
        told(outcome, len(outcomes))

    for number, job in enumerate(jobs):
        if _is_done(job, settings.out / job.name):
            keep(number, _outcome(job, settings.out / job.name, "kept"))
    # Alone, a job has all threads; several share the cores, one each.
    threads = None if settings.processes == 1 and settings.cluster is None else 1
    suspects: list[int] = []
    while todo := [k for k in range(len(jobs)) if k not in outcomes]:
        # Of several jobs that were in work when a process was ended, each is tried alone.
        suspects = [k for k in suspects if k in todo]
        group = suspects[:1] or todo
        tasks = [
            _Task(jobs[k], settings.out / jobs[k].name, settings.pictures, settings.report, threads)
            for k in group
        ]
        processes = min(settings.processes, len(group))
        try:
            with open_workers(processes, settings.cluster, 1, apart=True) as workers:
                for number, outcome in workers.run(run_job, tasks):
                    keep(group[number], outcome)
        except WorkerEndedError as error:
            ended = [group[number] for number in error.tasks]
            if len(ended) == 1:
                keep(ended[0], Outcome(jobs[ended[0]], "failed", str(error)))
            else:
                suspects = ended
    return [outcomes[k] for k in range(len(jobs))]


def run_job(task: _Task) -> Outcome:
    """Carries out one job; what the user can correct is an outcome, a bug is raised."""
    job, started = task.job, time.perf_counter()
    try:
        output = Output(task.out, overwrite=is_result(task.out), pictures=task.pictures)
        fit(job.open(), output, job.estimator_settings(task.threads), job.estimator)
        if task.report:
            write_report(task.out)
        with replacing(task.out / JOB) as partial:
            partial.write_text(as_json(_identity(job)), encoding="utf-8")
    except InputError as error:
        seconds = time.perf_counter() - started
        return Outcome(job, "failed", " ".join(str(error).split()), seconds)
    return _outcome(job, task.out, "done", time.perf_counter() - started)


def _identity(job: Job) -> dict[str, object]:
    """What a result must have been made from to be kept."""
    return {"voxelpose": __version__, **asdict(job)}


def _is_done(job: Job, folder: Path) -> bool:
    try:
        made = json.loads((folder / JOB).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return is_result(folder) and made == json.loads(as_json(_identity(job)))


def _outcome(
    job: Job, folder: Path, status: Literal["done", "kept"], seconds: float | None = None
) -> Outcome:
    summary: Any = Result.open(folder).summary
    score: Mapping[str, Any] = {}
    if (Path(job.recording) / TRUTH).is_file():
        try:
            score = asdict(evaluate(folder, Path(job.recording) / TRUTH))
        except (InputError, ValueError):  # a truth that does not fit is no reason to fail
            score = {}
    total = float(summary["seconds"]["total"]) if seconds is None else seconds
    return Outcome(job, status, "", total, summary, score)
