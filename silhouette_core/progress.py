"""Progress of long work: what is told of it, and how long its stages took."""

from __future__ import annotations

import time
from array import array
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Reporter(Protocol):
    """Hears how far an estimator is. The command line draws it; libraries stay silent."""

    def stage(self, name: str, total: int | None = None) -> None:
        """A stage begins, of `total` steps (None: unknown); the stage before is over."""
        ...

    def advance(self, steps: int = 1) -> None:
        """So many steps of the stage are done."""
        ...

    def note(self, text: str) -> None:
        """Something the user should know that is no error: an assumption made, a camera left out."""
        ...


class SilentReporter:
    """The reporter that tells nobody."""

    def stage(self, name: str, total: int | None = None) -> None:
        """Does nothing."""

    def advance(self, steps: int = 1) -> None:
        """Does nothing."""

    def note(self, text: str) -> None:
        """Does nothing."""


class StageClock:
    """How long every stage took, per frame."""

    def __init__(self) -> None:
        """Starts with nothing."""
        self.seconds: dict[str, array[float]] = defaultdict(lambda: array("d"))

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Times a block."""
        started = time.perf_counter()
        yield
        self.seconds[stage].append(time.perf_counter() - started)
