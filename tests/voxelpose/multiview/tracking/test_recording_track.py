"""Tracking of one recording."""

from types import SimpleNamespace

import pytest

from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter, StageClock
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.tracking.recording_track import TrackWork, alternated


def test_who_is_followed_again_is_fitted_first_and_searched_in_the_anchor_frames():
    done, told = [], (StageClock(), SilentReporter())
    tracker = SimpleNamespace(observations=range(1400))
    for name in ("smooth", "search", "search_worst", "search_limbs", "reach_targets"):
        setattr(tracker, name, lambda *given, name=name: done.append((name, *given)))
    TrackWork(Settings(), 10, MatchSettings(), None, *told).again(tracker, [0, 1])
    assert done == [
        ("smooth",),
        ("search", [0, 1]),
        ("search_worst", 14),
        ("search_limbs",),
        ("reach_targets",),
    ]


@pytest.mark.parametrize(("better", "expected"), [(0, 0), (1, 1), (5, 2)])
def test_silhouettes_and_bodies_alternate_while_it_gets_better_and_twice_at_most(better, expected):
    class Counted:
        def first(self):
            return [0]

        def again(self, tracked):
            return [tracked[0] + 1] if tracked[0] < better else None

    assert alternated(Counted()) == [expected]  # type: ignore[arg-type]
