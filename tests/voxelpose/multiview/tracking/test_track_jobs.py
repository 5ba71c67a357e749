"""Catching up; tables of errors stand for what refinement finds."""

from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.motion.pose import Pose
from voxelpose.multiview.proposers.pose_search import PoseFit
from voxelpose.multiview.tracking import follower
from voxelpose.multiview.tracking.body_track import RECENT, BodyTrack, Moment
from voxelpose.multiview.tracking.follower import catch_up


@dataclass(frozen=True)
class Track:
    """A track that steps as a table of errors by time says; 0.1 where it says nothing."""

    table: dict[float, float] = field(default_factory=dict)
    time_s: float = 0.0
    error: float = 0.1
    steps: list[float] = field(default_factory=list)
    usual = 0.1

    @property
    def fit(self):
        return SimpleNamespace(error=self.error, pose=None)

    def is_poor(self, error):
        return False  # nothing is looked for far away

    def follow(self, rig, moment):
        self.steps.append(moment.time_s)
        return replace(self, time_s=moment.time_s, error=self.table.get(moment.time_s, 0.1))


def moments(count: int, interval_s: float) -> list:
    return [SimpleNamespace(time_s=k * interval_s) for k in range(1, count + 1)]


@pytest.fixture(autouse=True)
def no_limbs_found(monkeypatch):
    monkeypatch.setattr(follower, "search_limbs", lambda *given: None)


def test_every_other_frame_is_passed_over_but_not_the_last_ones():
    track = Track()
    assert catch_up(None, track, moments(10, 0.03)) is not None  # type: ignore[arg-type]
    assert [round(t / 0.03) for t in track.steps] == [2, 4, 6, 8, 9, 10]


def test_of_frames_far_apart_none_is_passed_over():
    track = Track()
    assert catch_up(None, track, moments(4, 0.1)) is not None  # type: ignore[arg-type]
    assert len(track.steps) == 4


@pytest.mark.parametrize(
    ("wrong", "lost"), [((1, 2, 3, 4, 5), True), ((1, 2, 3, 4, 6, 7, 8, 9), False)]
)
def test_a_track_that_is_wrong_in_five_frames_running_is_lost(wrong, lost):
    later = moments(9, 0.1)
    track = Track({later[k - 1].time_s: 0.2 for k in wrong})
    assert (catch_up(None, track, later) is None) == lost  # type: ignore[arg-type]


def test_a_track_that_explains_nothing_is_lost():
    later = moments(3, 0.1)
    assert catch_up(None, Track({later[1].time_s: 0.5}), later) is None  # type: ignore[arg-type]


def test_limbs_are_searched_once_where_the_error_jumps(monkeypatch):
    searched = []

    def search_limbs(rig, track, moment):
        searched.append(moment.time_s)
        return replace(track, error=0.1)

    monkeypatch.setattr(follower, "search_limbs", search_limbs)
    later = moments(6, 0.2)
    track = Track({later[1].time_s: 0.3, later[3].time_s: 0.3})
    assert catch_up(None, track, later) is not None  # type: ignore[arg-type]
    assert searched == [later[1].time_s]


@pytest.mark.parametrize(("after_s", "found"), [(0.5, True), (0.03, False)])
def test_after_a_long_time_the_person_is_looked_for_where_the_silhouettes_are(
    monkeypatch, after_s, found
):
    grid = SimpleNamespace(occupied_points=lambda occupancy: np.array([[1.2, 0.0, 0.4]]))
    hull = SimpleNamespace(grid=grid, occupancy=None)
    monkeypatch.setattr(follower, "_hull", lambda rig, moment: hull)
    body = SimpleNamespace(
        surface=SimpleNamespace(posed=lambda pose: SimpleNamespace(points=pose.root_m[None]))
    )
    track = BodyTrack(body, 0.0, PoseFit(Pose(np.zeros(3), np.eye(3), np.zeros(0)), 0.1))  # type: ignore[arg-type]

    def follow(self, rig, moment):
        there = abs(self.fit.pose.root_m[0] - 1.2) < 0.01
        return replace(
            self, time_s=moment.time_s, fit=replace(self.fit, error=0.1 if there else 0.6)
        )

    monkeypatch.setattr(BodyTrack, "follow", follow)
    stepped = follower.followed(None, track, Moment(after_s, {}))  # type: ignore[arg-type]
    assert (stepped.fit.error == 0.1) == found
    assert stepped.fit.pose.root_m[2] == 0  # a hull is no height of the hips
    assert not found or stepped.before[0] == 0.0  # it knows how fast they go


@pytest.mark.parametrize(("gap_s", "at_once"), [(0.5, True), (0.05, False)])
def test_at_low_rates_what_was_found_counts_at_once(monkeypatch, gap_s, at_once):
    done: Future = Future()
    done.set_result(SimpleNamespace(time_s=0.0, fit=SimpleNamespace(error=0.1)))
    submitted = []
    one = follower.PoseFollower(None, None, None)  # type: ignore[arg-type]
    one._previous_s = 4 * gap_s
    one._job, one._since = done, moments(4, gap_s)
    monkeypatch.setattr(one, "_submit", lambda work, *given: submitted.append(work))
    monkeypatch.setattr(one, "_begin_job", lambda moment: None)
    monkeypatch.setattr(follower, "followed", lambda rig, track, moment: track)
    fit = one.step(Moment(5 * gap_s, {}))
    assert (fit is not None) == at_once
    assert submitted == ([] if at_once else [catch_up])


def test_a_lost_track_is_looked_for_a_while(monkeypatch):
    one = follower.PoseFollower(None, None, None)  # type: ignore[arg-type]
    one._track = track = SimpleNamespace(time_s=0.0, fit=SimpleNamespace(error=0.6))
    monkeypatch.setattr(one, "_begin_job", lambda moment: None)
    monkeypatch.setattr(follower, "followed", lambda rig, track, moment: track)
    for k in range(1, RECENT + 1):
        assert one.step(Moment(k / 30, {})) is None
        assert one.expected is track
    one.step(Moment(1.0, {}))
    assert one.expected is None
