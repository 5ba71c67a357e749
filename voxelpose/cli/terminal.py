"""Text for a terminal, which what comes from files and names cannot control, and progress: a bar
on a terminal, plain lines elsewhere.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, TextIO

from calib.errors import visible
from silhouette_core.progress import OverallProgress

if TYPE_CHECKING:
    from rich.console import Console


_LONGEST = 1000  # characters of a message


def message(text: object) -> str:
    """A message as one visible line, cut where it is too long to be read."""
    line = visible(" ".join(str(text).split()))
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]} ... ({len(line)} characters)"


def plain(text: object) -> str:
    """Text from outside for rich, which would take [words in brackets] for its own markup."""
    from rich.markup import escape

    return escape(visible(text))


class VisibleStream:
    """Stream that writes text to another one, control characters made visible."""

    def __init__(self, stream: TextIO):
        self.stream = stream

    def write(self, text: str) -> int:
        """Writes text; returns its length."""
        self.stream.write(visible(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def rich_console(stderr: bool = False, soft_wrap: bool = False) -> Console:
    """Console of rich on a standard stream, which writes its own control characters."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    file = stream.stream if isinstance(stream, VisibleStream) else stream
    return Console(file=file, highlight=False, soft_wrap=soft_wrap)


def print_table(rows: Iterable[Sequence[str]], *columns: str) -> None:
    """Prints rows of rich's markup below the columns' names, if there are any; no rows: nothing."""
    from rich.table import Table

    table = Table(*columns, box=None, show_header=bool(columns), padding=(0, 2, 0, 0))
    for row in rows:
        table.add_row(*row)
    if table.row_count:
        rich_console().print(table)


class Progress:
    """Reporter that draws one progress bar on stderr, with the time that is left.

    Where stderr is not a terminal (a log, a pipe), it writes one line at the end of every stage. As
    a context manager it adds the stage and its progress to a KeyboardInterrupt.
    """

    def __init__(self, shares: Mapping[str, int] | None = None) -> None:
        """Prepares one bar over all stages, by the `shares` of the time that they usually take in
        their order, while others do not move it; None: every stage begins anew.
        """
        self._overall = None if shares is None else OverallProgress(shares)
        self._name, self._total, self._done, self._started = "", None, 0, 0.0
        self._bar = None
        self._beside = ExitStack()
        if sys.stderr.isatty():
            from rich import progress

            self._bar = progress.Progress(
                progress.SpinnerColumn(),
                progress.TextColumn("{task.description:<24}"),
                progress.BarColumn(),
                progress.TaskProgressColumn(),
                progress.TimeElapsedColumn(),
                progress.TimeRemainingColumn(),
                console=rich_console(stderr=True),
                speed_estimate_period=3600,
            )
            self._task = self._bar.add_task("", total=1.0 if shares else None)

    def __enter__(self) -> Progress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._beside.close()
        if error is None:
            self._finish()
        if self._bar is not None:
            if error is None:
                total = self._bar.tasks[0].total or 1
                self._bar.update(self._task, total=total, completed=total)
            self._bar.stop()
        if isinstance(error, KeyboardInterrupt):
            error.args = (self.where(),) if self._name else ()

    def stage(self, name: str, total: int | None = None) -> None:
        """Ends the previous stage and starts a new one."""
        self._finish()
        self._name, self._total, self._done, self._started = name, total, 0, time.perf_counter()
        if self._bar is not None and self._overall is None:
            self._bar.reset(self._task, total=total)
        if self._bar is not None:
            self._bar.update(self._task, description=name)
            self._draw_progress()

    def advance(self, steps: int = 1) -> None:
        """Counts completed steps of the stage."""
        self._done += steps
        self._draw_progress()

    def note(self, text: str) -> None:
        """Writes a line above the progress bars."""
        line = message(f"note: {text}")
        if self._bar is not None:
            self._bar.console.print(plain(line))
        else:
            print(line, file=sys.stderr, flush=True)

    def note_compilation(self, *estimators: str) -> None:
        """Notes that the first run compiles, where the compilation cache is empty, and begins to
        compile what estimators need in a process beside this one.
        """
        from voxelpose.compile_ahead import compiling_beside

        self._beside.enter_context(compiling_beside(self, estimators))

    def where(self) -> str:
        """Returns the stage and its progress: "during matching, after 37 of 100 steps"."""
        total = f" of {self._total}" if self._total is not None else ""
        steps = f", after {self._done}{total} steps" if self._total or self._done else ""
        return f"during {self._name}{steps}"

    def _draw_progress(self) -> None:
        if self._bar is None:
            return
        completed = float(self._done)
        if self._overall is not None:
            completed = self._overall.part(self._name, self._done, self._total)
        self._bar.update(self._task, completed=completed)

    def _finish(self) -> None:
        if not self._name:
            return
        if self._bar is None:
            steps = f", {self._done} steps" if self._done else ""
            elapsed_s = time.perf_counter() - self._started
            print(f"{self._name}: {elapsed_s:.1f} s{steps}", file=sys.stderr, flush=True)
        self._name = ""
