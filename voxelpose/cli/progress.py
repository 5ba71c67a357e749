"""Progress on the terminal, or in plain lines where there is none."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import TracebackType

import silhouette_core


class Progress:
    """A reporter that draws a bar per stage on stderr.

    Where stderr is no terminal (a log, a pipe), it writes one line when a stage is over. As a
    context manager it adds to a KeyboardInterrupt how far the work had come.
    """

    def __init__(self) -> None:
        """Draws nothing yet."""
        self._name, self._total, self._done, self._started = "", None, 0, 0.0
        self._bar = None
        if sys.stderr.isatty():
            from rich.console import Console
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
                *columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)
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
        """Starts a stage."""
        self._finish()
        self._name, self._total, self._done, self._started = name, total, 0, time.perf_counter()
        if self._bar is not None:
            self._task = self._bar.add_task(name, total=total)

    def advance(self, steps: int = 1) -> None:
        """Counts steps of the stage."""
        self._done += steps
        if self._bar is not None and self._name:
            self._bar.advance(self._task, steps)

    def note(self, text: str) -> None:
        """Writes a line above the bars."""
        line = f"note: {text}"
        if self._bar is not None:
            self._bar.console.print(line, highlight=False)
        else:
            print(line, file=sys.stderr, flush=True)

    def note_compilation(self) -> None:
        """Says that the first run compiles, where nothing compiled is kept yet."""
        folders = (
            [Path(os.environ["NUMBA_CACHE_DIR"])]
            if os.environ.get("NUMBA_CACHE_DIR")
            else [Path(silhouette_core.__file__).parent]
        )
        if not any(kept for folder in folders for kept in folder.rglob("*.nbi")):
            self.note(
                "first run on this machine: the fast code is compiled as it is met, once; later"
                " runs are much quicker"
            )

    def where(self) -> str:
        """Says how far the stage has come: "during matching, after 37 of 100 frames"."""
        of = f" of {self._total}" if self._total is not None else ""
        return (
            f"during {self._name}, after {self._done}{of} steps"
            if self._total or self._done
            else f"during {self._name}"
        )

    def _finish(self) -> None:
        if not self._name:
            return
        if self._bar is not None:
            self._bar.update(
                self._task,
                total=self._total or self._done or 1,
                completed=self._total or self._done or 1,
            )
        else:
            steps = f", {self._done} steps" if self._done else ""
            print(
                f"{self._name}: {time.perf_counter() - self._started:.1f} s{steps}",
                file=sys.stderr,
                flush=True,
            )
        self._name = ""
