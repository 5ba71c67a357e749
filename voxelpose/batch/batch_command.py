"""voxelpose batch."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg

from voxelpose.cli import arguments

if TYPE_CHECKING:
    from voxelpose.batch.run import Outcome


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Estimates the motion in many recordings, several at a time.

    Each PATH is a recording, a folder of recordings, or a TOML list with the settings of each. DIR
    receives a folder with result and report for each, table.csv, table.md and index.html, which
    shows all with their verdicts, the doubtful ones first, and each of several people. A recording
    that fails does not stop the others. Run again, the same command does what is missing, what
    failed, and what has other settings now.

      voxelpose batch subjects/*/walk --out walks --set stature=1.75
      voxelpose batch subjects.toml --out results --jobs 4
      voxelpose batch clips --command track --set camera=cam_1 --out tracked
      voxelpose batch long_take --out result --pieces 60
      voxelpose batch subjects --out results --cluster tcp://10.0.0.5:8786

    A list (docs/guide.md has more): [settings] for all, then for each
      [[recording]]
      folder = "anna/walk"
      stature = 1.62

    Exit code 0: all done; 1: one failed.
    """

    paths: Annotated[Positional[tuple[Path, ...]], arg(metavar="PATH")]
    """Recordings, folders of recordings, or TOML lists."""
    out: Annotated[Path, arg(metavar="DIR")]
    """Folder of the results; made if it is not there."""
    command: Literal["fit", "track"] = "fit"
    """What to do where a list does not say: several cameras (fit) or one (track)."""
    set: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=VALUE")] = ()
    """Setting for all: an option of `fit` or `track` by its name; may be repeated."""
    jobs: Annotated[int | None, arguments.optional("N")] = None
    """Recordings at a time. Default: as many as there are cores, and as memory allows."""
    pieces: Annotated[float | None, arguments.optional("SECONDS")] = None
    """Divide recordings of several cameras that are longer into pieces of about so many seconds,
    estimated side by side and joined; all have the body that the first piece finds."""
    cluster: Annotated[str | None, arguments.optional("ADDRESS")] = None
    """Scheduler of a Dask cluster that works instead; it must see the same folders."""
    pictures: bool = True
    """Draw overlay videos and contact sheets."""
    report: bool = True
    """Write report.html for each."""

    def run(self) -> int:
        """Runs the batch; returns the exit code."""
        import psutil

        from calib.errors import InputError
        from voxelpose.batch.batch_tables import write_tables
        from voxelpose.batch.jobs import jobs_of, read_settings
        from voxelpose.batch.run import BatchSettings, run_batch

        listed = jobs_of(self.paths, self.command, read_settings(self.set))
        jobs = [job.with_folder_settings() for job in listed]
        if self.pieces is not None and not self.pieces > 0:
            raise InputError(f"--pieces {self.pieces} is impossible: give a length in seconds")
        memory_gib = int(psutil.virtual_memory().total / 2**30)  # a core needs one
        processes = self.jobs or max(1, min(os.cpu_count() or 1, memory_gib))
        if self.pieces is None:
            processes = min(processes, len(jobs))
        settings = BatchSettings(
            self.out, processes, self.cluster, self.pictures, self.report, self.pieces
        )
        where = f"the cluster {self.cluster}" if self.cluster else f"{processes} at a time"
        print(f"{len(jobs)} recordings, {where}", flush=True)
        finished: list[str] = []

        def tell(outcome: Outcome, count: int | None) -> None:
            if count is None:
                _print_outcome(outcome, " ")
                return
            finished.append(outcome.job.name)
            _print_outcome(outcome, f"[{count}/{len(jobs)}]")

        try:
            outcomes = run_batch(jobs, settings, tell)
        except KeyboardInterrupt:
            print(
                f"voxelpose: interrupted after {len(finished)} of {len(jobs)}; results are kept,"
                " and the same command goes on from there",
                file=sys.stderr,
            )
            return 130
        for path in write_tables(outcomes, self.out):
            print(path)
        return 1 if any(outcome.status == "failed" for outcome in outcomes) else 0


def _print_outcome(outcome: Outcome, place: str) -> None:
    words = f"{len(outcome.people)} people, " if outcome.people else ""
    words += str(outcome.verdict)
    if outcome.status != "failed":
        words += " (kept)" if outcome.status == "kept" else f" ({outcome.seconds:.0f} s)"
    print(f"{place} {outcome.job.name}: {words}", flush=True)
