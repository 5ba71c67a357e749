"""Tracking of one recording."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np

from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter, StageClock
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.tracking.recording_track import TrackWork


def tracked(error, at_m=None):
    """A tracker with the same error everywhere, and its start; joints lie the farther, the larger
    it is.
    """
    start = SimpleNamespace(candidate=SimpleNamespace(objects=False), cost_of=np.mean)
    body = SimpleNamespace(model=None)
    joints_m = np.full((2, 15, 3), error if at_m is None else at_m)
    seen = SimpleNamespace(there=np.ones(2, bool), places_m=None)
    tracker = SimpleNamespace(
        error=np.full(2, error), body=body, poses=[None] * 2, observations=seen
    )
    tracker.joints_m = lambda: joints_m
    return tracker, start


def test_who_is_followed_again_is_searched_in_the_anchor_frames_and_the_best_carried_first():
    (tracker, _), done = tracked(0.1), []

    def anchor(t):
        found = {0: 0.08, 1: 0.05}.get(t)
        if found is not None:
            tracker.error[t] = found
        return found is not None

    tracker.error = np.full(3, 0.1)
    tracker.observations = MagicMock(there=np.ones(3, bool))
    tracker.anchor, tracker.carry = anchor, lambda t: done.append(t)
    for name in ("polish", "repair", "mend_jumps", "recheck"):
        setattr(tracker, name, lambda *_, name=name: done.append(name))
    told = StageClock(), SilentReporter()
    work = TrackWork(Settings(), 10, MatchSettings(), None, *told)
    work.again(tracker, [0, 1, 2])
    assert done == ["polish", 1, 0, "repair", "mend_jumps", "recheck"]
