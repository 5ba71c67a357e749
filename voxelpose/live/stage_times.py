"""Durations of the stages of a session."""

import threading
import time
from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_RECENT = 60  # frames
_KEPT = 20_000  # frames: a session may last for days


class StageTimes:
    """Durations by stage; may be read by any thread while one adds to them."""

    def __init__(self) -> None:
        """Starts without frames."""
        self._lock = threading.Lock()
        self.reset()

    def reset(self) -> None:
        """Forgets all frames, for example those of the first seconds."""
        with self._lock:
            self.frames = 0
            self._stages: dict[str, deque[float]] = {}
            self._ends: deque[float] = deque(maxlen=_RECENT)

    def add(self, stage_s: Mapping[str, float]) -> None:
        """Adds one frame's seconds by stage."""
        with self._lock:
            self.frames += 1
            self._ends.append(time.monotonic())
            for name, seconds in stage_s.items():
                self._stages.setdefault(name, deque(maxlen=_KEPT)).append(seconds)

    @property
    def fps(self) -> float:
        """Frames per second, of the last ones."""
        with self._lock:
            ends = list(self._ends)
        return (len(ends) - 1) / (ends[-1] - ends[0]) if len(ends) > 1 else 0.0

    def medians(self) -> dict[str, float]:
        """Median seconds of every stage in the last frames."""
        return {name: float(np.median(spent[-_RECENT:])) for name, spent in self._spent().items()}

    def summary(self) -> dict[str, list[float]]:
        """Shortest, longest, mean, median, 95 and 99 % quantile of every stage, s, since the start;
        of a long session in the last 20 000 frames.
        """
        return {
            name: [s.min(), s.max(), s.mean(), *np.quantile(s, (0.5, 0.95, 0.99))]
            for name, s in self._spent().items()
        }

    def _spent(self) -> dict[str, NDArray[np.float64]]:
        with self._lock:
            return {name: np.array(seconds) for name, seconds in self._stages.items()}
