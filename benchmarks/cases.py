"""Named cases, each timed against a reference in the same run."""

import gc
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Timed:
    """Something to time.

    Attributes:
        run: What is timed; it is given what `prepare` returns, and returns something to check.
        prepare: Done before every run, outside of the time.
        repeats: Runs in each round.
    """

    run: Callable[[Any], Any]
    prepare: Callable[[], Any] = lambda: None
    repeats: int = 1

    def seconds(self) -> float:
        """Runs all repeats and returns the shortest time."""
        best = float("inf")
        for _ in range(self.repeats):
            given = self.prepare()
            started = time.perf_counter()
            self.run(given)
            best = min(best, time.perf_counter() - started)
        return best


@dataclass(frozen=True)
class Case:
    """Our way and another of doing the same thing.

    Attributes: ours: Our way. reference: The other way. reference_name: What it is. check: Given
        both results; says what is wrong, or nothing. rounds: How often both are run in turn; the
        shortest time of each counts. goal: The ratio that the project wants, in words. longer:
        Whether the ratio is ours / reference (how many times longer) and not reference / ours (how
        many times faster).
    """

    ours: Timed
    reference: Timed
    reference_name: str
    check: Callable[[Any, Any], str] = lambda ours, reference: ""
    rounds: int = 5
    goal: str = ""
    longer: bool = False


Maker = Callable[[], Case]
_makers: dict[str, Maker] = {}


def case(name: str) -> Callable[[Maker], Maker]:
    """Registers a function that makes a case; it is called only when the case is run."""

    def register(maker: Maker) -> Maker:
        _makers[name] = maker
        return maker

    return register


def names() -> Iterator[str]:
    """Returns the names of all cases, in the order in which they were registered."""
    return iter(_makers)


def run(name: str) -> str:
    """Runs a case, warm and in turn with its reference; returns its line."""
    this = _makers[name]()
    result = this.check(
        this.ours.run(this.ours.prepare()), this.reference.run(this.reference.prepare())
    )
    if result:
        sys.exit(f"{name}: {result}")
    ours_s = reference_s = float("inf")
    gc.disable()
    for _ in range(this.rounds):
        ours_s, reference_s = (
            min(ours_s, this.ours.seconds()),
            min(reference_s, this.reference.seconds()),
        )
    gc.enable()
    ratio = ours_s / reference_s if this.longer else reference_s / ours_s
    # "ratio N x" as such, for whoever reads the lines by program.
    text = (
        f"{name:<34}{_milliseconds(ours_s)}{_milliseconds(reference_s)}   ratio"
        f" {ratio:8.{1 if ratio < 100 else 0}f} x"
    )
    return (
        f"{text}   {'longer than' if this.longer else 'faster than'}"
        f" {this.reference_name}{f' (goal: {this.goal})' if this.goal else ''}"
    )


def _milliseconds(seconds: float) -> str:
    value = seconds * 1000
    return f"{value:12.{3 if value < 10 else 1}f} ms"
