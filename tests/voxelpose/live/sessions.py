"""Sessions with a stand-in for the estimator."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from silhouette_core.motion.pose import Pose
from tests.clips import waving
from voxelpose.live.live_estimators import LiveMoment, posed_body
from voxelpose.live.live_frame import LiveFrame, People
from voxelpose.live.session import LiveSession, SessionSettings

MOTION = waving(40)
STANDING = Pose(MOTION.root_m[0], np.eye(3), MOTION.angles_rad[0])


class Sees:
    """Estimator that finds a standing body wherever every camera has a silhouette; so many numbers
    before it are `absent`.
    """

    def __init__(self) -> None:
        self.closed = False
        self.fails_at = -1
        self.seen = 0
        self.absent = 0

    def prepare(self, moment: LiveMoment) -> int:
        self.seen += 1
        if self.seen == self.fails_at:
            raise RuntimeError("a stage that fails")
        return min(int(mask.sum()) for mask in moment.silhouettes.masks().values())

    def step(self, prepared: int) -> People:
        if prepared < 50:
            return (None,) * (1 + self.absent)
        return (*(None,) * self.absent, posed_body(MOTION.model, STANDING, 0.9, np.ones(15)))

    def close(self) -> None:
        self.closed = True


@contextmanager
def running(settings: SessionSettings) -> Iterator[tuple[LiveSession, Sees, list[LiveFrame]]]:
    """A session at work; checks that it leaves no thread behind."""
    before = set(threading.enumerate())
    estimator, frames = Sees(), []
    session = LiveSession(settings, estimator)
    session.receivers.append(frames.append)
    try:
        session.start_cameras()
        yield session, estimator, frames
    finally:
        session.close()
    assert estimator.closed
    assert not [thread for thread in set(threading.enumerate()) - before if thread.is_alive()]


def wait_until(true: Callable[[], bool], seconds: float = 60.0) -> None:
    end_s = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end_s, "it did not happen in time"
        time.sleep(0.02)
