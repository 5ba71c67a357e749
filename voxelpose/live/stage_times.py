"""Durations of the stages of a session: of recent frames, and since its start."""

import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

_RECENT = 60  # frames
_LONGEST_S = 10
_BINS_PER_S = 5000  # from which quantiles are read


@dataclass(frozen=True)
class Durations:
    """Durations of one stage, seconds.

    Attributes:
        least: the shortest.
        most: the longest.
        p95: 95 % are at most so long.
        p99: 99 % are at most so long.
    """

    least: float
    most: float
    mean: float
    median: float
    p95: float
    p99: float


class _Stage:
    """Histogram, extremes and sum of one stage; its memory does not grow."""

    def __init__(self) -> None:
        self.counts = np.zeros(_LONGEST_S * _BINS_PER_S + 1, np.int64)
        self.least, self.most, self.sum = np.inf, -np.inf, 0.0
        self.recent: deque[float] = deque(maxlen=_RECENT)

    def add(self, seconds: float) -> None:
        self.counts[int(np.clip(seconds * _BINS_PER_S, 0, len(self.counts) - 1))] += 1
        self.least, self.most = min(self.least, seconds), max(self.most, seconds)
        self.sum += seconds
        self.recent.append(seconds)

    def durations(self) -> Durations:
        total = np.cumsum(self.counts)
        bins = np.searchsorted(total, np.array([0.5, 0.95, 0.99]) * total[-1])
        quantiles = (bins + 0.5) / _BINS_PER_S
        return Durations(self.least, self.most, self.sum / total[-1], *quantiles.tolist())


class StageTimes:
    """Durations by stage; may be read by any thread while one adds to them."""

    def __init__(self) -> None:
        """Starts without frames."""
        self.frames = 0
        self._stages: dict[str, _Stage] = {}
        self._ends: deque[float] = deque(maxlen=_RECENT)
        self._lock = threading.Lock()

    def add(self, stage_s: Mapping[str, float]) -> None:
        """Adds one frame's seconds by stage."""
        with self._lock:
            self.frames += 1
            self._ends.append(time.monotonic())
            for name, seconds in stage_s.items():
                self._stages.setdefault(name, _Stage()).add(seconds)

    @property
    def fps(self) -> float:
        """Frames per second, of the last ones."""
        with self._lock:
            ends = list(self._ends)
        return (len(ends) - 1) / (ends[-1] - ends[0]) if len(ends) > 1 else 0.0

    def medians(self) -> dict[str, float]:
        """Median seconds of every stage in the last frames."""
        with self._lock:
            return {name: float(np.median(stage.recent)) for name, stage in self._stages.items()}

    def reset(self) -> None:
        """Forgets all frames, for example those of the first seconds."""
        with self._lock:
            self.frames = 0
            self._stages.clear()
            self._ends.clear()

    def summary(self) -> dict[str, Durations]:
        """Durations of every stage since the session's start."""
        with self._lock:
            return {name: stage.durations() for name, stage in self._stages.items()}
