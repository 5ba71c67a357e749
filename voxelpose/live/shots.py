"""Pictures of several cameras that were taken at one moment, matched by their time stamps."""

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from voxelpose.tuning import LIVE

_KEPT = 4  # pictures of each camera that wait for the others'
_BEGINNING_S = 2  # in which every camera's first picture is waited for
_SMOOTHED = 10  # intervals between pictures in their running mean

_Item = TypeVar("_Item")


class Newest(Generic[_Item]):
    """Place for one item between two threads: a newer one replaces it, and is `dropped`."""

    def __init__(self) -> None:
        """Starts empty."""
        self.dropped = 0
        self._item: _Item | None = None
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: _Item) -> None:
        """Puts an item there."""
        with self._changed:
            self.dropped += self._item is not None
            self._item = item
            self._changed.notify()

    def take(self) -> _Item | None:
        """Waits for an item and takes it; None after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            return None if self._closed else item

    def close(self) -> None:
        """Wakes whoever waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


@dataclass(frozen=True, eq=False)
class Shot:
    """Pictures taken at one moment.

    Attributes:
        number: counted from 0, shots that nobody took included.
        time_s: of the moment, s since the session's start.
        pictures: (H, W, 3) uint8 BGR by camera name.
    """

    number: int
    time_s: float
    pictures: Mapping[str, NDArray[np.uint8]]


@dataclass(eq=False)
class _Stream:
    """Latest pictures of one camera, their interval, and the time of that in the last shot."""

    pictures: deque[tuple[float, NDArray[np.uint8]]]
    interval_s: float = 0.0
    used_s: float = -np.inf

    @property
    def newest_s(self) -> float:
        return self.pictures[-1][0] if self.pictures else -np.inf

    def add(self, time_s: float, picture: NDArray[np.uint8]) -> None:
        step = time_s - self.newest_s
        if np.isfinite(step):
            old = self.interval_s
            self.interval_s = step if not old else old + (step - old) / _SMOOTHED
        self.pictures.append((time_s, picture))

    def nearest(self, time_s: float) -> tuple[float, NDArray[np.uint8]]:
        return min(self.pictures, key=lambda one: abs(one[0] - time_s))


class ShotMatcher:
    """Matches pictures by their time stamps, as soon as every camera that delivers has one.

    A camera that has been silent for a while is left out until it delivers again, but of several
    cameras two are needed.

    Args:
        names: of the cameras, in the calibration's order.
        now: seconds since the session's start.
        each: called with every shot, also with those that nobody takes; returns at once.
    """

    def __init__(
        self,
        names: Sequence[str],
        now: Callable[[], float],
        each: Callable[[Shot], None] | None = None,
    ):
        """Starts without pictures."""
        self.shots: Newest[Shot] = Newest()
        self._now, self._each = now, each
        self._streams = {name: _Stream(deque(maxlen=_KEPT)) for name in names}
        self._lock = threading.Lock()
        self._count = 0

    def deliver(self, name: str, time_s: float, picture: NDArray[np.uint8]) -> None:
        """Takes one picture of one camera; called by any thread."""
        with self._lock:
            self._streams[name].add(time_s, picture)
            shot = self._match(self._now())
            if shot is not None:
                self.shots.put(shot)
                if self._each is not None:
                    self._each(shot)

    def _match(self, now_s: float) -> Shot | None:
        delivering = {
            name: stream
            for name, stream in self._streams.items()
            if now_s - stream.newest_s <= max(LIVE.silent_s, 3 * stream.interval_s)
        }
        begins = now_s < _BEGINNING_S
        if begins and not all(one.pictures for one in self._streams.values()):
            return None
        if len(delivering) < min(2, len(self._streams)):
            return None
        moment = min(stream.newest_s for stream in delivering.values())
        shortest = min(stream.interval_s for stream in delivering.values())
        chosen = {name: stream.nearest(moment) for name, stream in delivering.items()}
        apart = max(abs(time_s - moment) for time_s, _ in chosen.values())
        if shortest > 0 and apart > LIVE.apart * shortest:
            return None
        if any(time_s <= delivering[name].used_s for name, (time_s, _) in chosen.items()):
            return None
        for name, (time_s, _) in chosen.items():
            delivering[name].used_s = time_s
        shot = Shot(self._count, moment, {name: p for name, (_, p) in chosen.items()})
        self._count += 1
        return shot
