"""Progress reports of long work, and durations of its stages."""

import time
from array import array
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol


class Reporter(Protocol):
    """Receives the progress of an estimator; the command line draws it, libraries stay silent."""

    def stage(self, name: str, total: int | None = None) -> None:
        """Begins a stage of `total` steps (None: unknown) and ends the previous one."""

    def advance(self, steps: int = 1) -> None:
        """Counts finished steps of the stage."""

    def note(self, text: str) -> None:
        """Informs the user of something that is no error, such as an assumption."""


class SilentReporter:
    """Reporter without output."""

    def stage(self, name: str, total: int | None = None) -> None:
        """Does nothing."""

    def advance(self, steps: int = 1) -> None:
        """Does nothing."""

    def note(self, text: str) -> None:
        """Does nothing."""


class OverallProgress:
    """How far work of several stages is, by the share of the time that each usually takes."""

    def __init__(self, shares: Mapping[str, float]) -> None:
        self._shares, self._part = shares, 0.0

    def part(self, stage: str, done: int, total: int | None) -> float:
        """Part of the whole, 0 to 1, after `done` of the `total` steps of a stage (None: unknown);
        a stage without a share does not move it, and one that is run again does not move it back.
        """
        if stage in self._shares:
            names = list(self._shares)
            before = sum(self._shares[name] for name in names[: names.index(stage)])
            within = min(1.0, done / total) if total else 0.0
            now = (before + self._shares[stage] * within) / sum(self._shares.values())
            self._part = max(self._part, now)
        return self._part


class StageClock:
    """Durations of the stages, per frame.

    Attributes:
        seconds: durations by stage, in order.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, array[float]] = defaultdict(lambda: array("d"))

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Times a block."""
        started = time.perf_counter()
        yield
        self.seconds[stage].append(time.perf_counter() - started)
