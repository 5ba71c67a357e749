"""Progress bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import TracebackType

import silhouette_core
from voxelpose.cli.terminal import message, plain, rich_console


class Progress:
    """Reporter that draws a progress bar per stage on stderr.

    Where stderr is not a terminal (a log, a pipe), it writes one line at the end of every stage. As
    a context manager it adds the stage and its progress to a KeyboardInterrupt.
    """

    def __init__(self) -> None:
        """Prepares the progress bars."""
        self._name, self._total, self._done, self._started = "", None, 0, 0.0
        self._bar = None
        if sys.stderr.isatty():
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                SpinnerColumn,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )
            from rich.progress import Progress as Bar

            columns = (
                SpinnerColumn(),
                TextColumn("{task.description:<24}"),
                BarColumn(),
                MofNCompleteColumn(),
            )
            self._bar = Bar(
                *columns,
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=rich_console(stderr=True),
            )

    def __enter__(self) -> Progress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self._finish()
        if self._bar is not None:
            self._bar.stop()
        if isinstance(error, KeyboardInterrupt):
            error.args = (self.where(),) if self._name else ()

    def stage(self, name: str, total: int | None = None) -> None:
        """Ends the previous stage and starts a new one."""
        self._finish()
        self._name, self._total, self._done, self._started = name, total, 0, time.perf_counter()
        if self._bar is not None:
            self._task = self._bar.add_task(name, total=total)

    def advance(self, steps: int = 1) -> None:
        """Counts completed steps of the stage."""
        self._done += steps
        if self._bar is not None and self._name:
            self._bar.advance(self._task, steps)

    def note(self, text: str) -> None:
        """Writes a line above the progress bars."""
        line = message(f"note: {text}")
        if self._bar is not None:
            self._bar.console.print(plain(line))
        else:
            print(line, file=sys.stderr, flush=True)

    def note_compilation(self) -> None:
        """Notes that the first run compiles, where the compilation cache is empty."""
        cache = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(silhouette_core.__file__).parent)
        if next(cache.rglob("*.nbi"), None) is None:
            self.note(
                "first run on this machine: the program is compiled, once; later runs are much"
                " faster"
            )

    def where(self) -> str:
        """Returns the stage and its progress: "during matching, after 37 of 100 steps"."""
        total = f" of {self._total}" if self._total is not None else ""
        steps = f", after {self._done}{total} steps" if self._total or self._done else ""
        return f"during {self._name}{steps}"

    def _finish(self) -> None:
        if not self._name:
            return
        if self._bar is not None:
            total = self._total or self._done or 1
            self._bar.update(self._task, total=total, completed=total)
        else:
            steps = f", {self._done} steps" if self._done else ""
            elapsed_s = time.perf_counter() - self._started
            print(f"{self._name}: {elapsed_s:.1f} s{steps}", file=sys.stderr, flush=True)
        self._name = ""
