"""Tracking of one recording."""

from types import SimpleNamespace

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


def test_who_is_followed_again_is_fitted_first_and_searched_in_the_anchor_frames():
    done, told = [], (StageClock(), SilentReporter())
    tracker = SimpleNamespace(observations=range(1400))
    for name in ("smooth", "search", "search_worst", "search_limbs"):
        setattr(tracker, name, lambda *given, name=name: done.append((name, *given)))
    TrackWork(Settings(), 10, MatchSettings(), None, *told).again(tracker, [0, 1])
    assert done == [("smooth",), ("search", [0, 1]), ("search_worst", 14), ("search_limbs",)]
