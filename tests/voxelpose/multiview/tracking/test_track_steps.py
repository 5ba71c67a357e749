"""The tracker's decisions, where rules stand for silhouettes: see `Rules`."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.motion.dynamics import MOMENTUM
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import fitting_model, stance
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import PoseFit
from voxelpose.multiview.tracking import body_track, tracking
from voxelpose.multiview.tracking.tracking import PoseTracker

MODEL = fitting_model()


def at(x_m: float, yaw_deg: float = 0.0) -> Pose:
    step = np.zeros(6 + MODEL.dof_count)
    step[5] = np.radians(yaw_deg)
    return stance(MODEL, place_m=(x_m, 0.0)).moved(step)


def is_turned(pose: Pose) -> bool:
    return pose.root_rotation[0, 0] < 0


class Frames:
    """An observation per frame: its number; none where nobody is."""

    def __init__(self, count: int):
        self._count, self.there = count, np.ones(count, np.bool_)

    def __len__(self) -> int:
        return self._count

    def observe(self, t, near_m):
        if not self.there[t]:
            return None
        return SimpleNamespace(observation=t, grid=None, occupancy=None)


class Rules:
    """What the searches find; by default a refinement ends at its prior, and nothing else is done.

    Attributes:
        error: of a pose in a frame.
        refined: frames in which a pose was refined.
    """

    def __init__(self, monkeypatch):
        self.error = lambda t, pose: 0.1
        self.refined = []
        for module, name in (
            (body_track, "refine_fit"),
            (body_track, "move_limbs"),
            (tracking, "move_limbs"),
            (tracking, "find_pose"),
        ):
            monkeypatch.setattr(module, name, getattr(self, name))

    def refine_fit(self, body, observation, start, prior, settings):
        self.refined.append(observation)
        return PoseFit(prior.pose, self.error(observation, prior.pose))

    def move_limbs(self, body, observation, fit):
        return fit

    def find_pose(self, body, frame, settings):
        raise AssertionError("a search without a prior")


@pytest.fixture
def rules(monkeypatch) -> Rules:
    return Rules(monkeypatch)


def tracker_of(count: int, fps: float = 30.0) -> PoseTracker:
    body = SimpleNamespace(model=MODEL, body_volume=SimpleNamespace(backend=None), surface=None)
    settings = fps, MatchSettings()
    return PoseTracker(body, Frames(count), *settings, lambda _: nullcontext(), lambda: None)  # type: ignore[arg-type]


def posed(poses: list[Pose | None], errors: np.ndarray) -> PoseTracker:
    tracker = tracker_of(len(poses))
    tracker.poses, tracker.error[:] = list(poses), errors
    return tracker


def places(tracker: PoseTracker) -> list[float | None]:
    return [None if pose is None else pose.root_m[0] for pose in tracker.poses]


def test_a_pose_is_followed_both_ways_and_the_last_step_expected_again(rules, monkeypatch):
    steps = {1: 0.1, 0: -0.2}

    def refine_fit(body, observation, start, prior, settings):
        return PoseFit(at(prior.pose.root_m[0] + steps.pop(observation, 0.0)), 0.1)

    monkeypatch.setattr(body_track, "refine_fit", refine_fit)
    tracker = tracker_of(4)
    tracker.follow([(2, PoseFit(at(0.0), 0.1))])
    back = 0.1 + 0.1 * MOMENTUM - 0.2
    assert places(tracker) == pytest.approx([back, 0.1, 0.0, 0.0])


def test_what_comes_to_the_same_pose_ends_there(rules):
    tracker = tracker_of(9)
    tracker.follow([(1, PoseFit(at(0.0), 0.1)), (7, PoseFit(at(0.02), 0.09))])
    assert sorted(rules.refined) == [0, 1, 2, 2, 3, 4, 5, 6, 8]
    assert places(tracker) == pytest.approx([0.0] * 2 + [0.02] * 7)


def test_of_two_poses_that_are_the_same_the_better_one_stays(rules):
    tracker = tracker_of(1)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    for error, place in ((0.2, 0.0), (0.05, 0.01)):
        tracker.follow([(0, PoseFit(at(0.01), error))])
        assert places(tracker) == [place]


def turned_frames(rules, right: float, frames: range) -> list[int]:
    """Frames turned half round where in some the turned pose explains more, and in the others less;
    one is searched in the first frame, in the last, and in those.
    """
    rules.error = lambda t, pose: right if (t in frames) == is_turned(pose) else 0.12
    tracker = tracker_of(20)
    starts = [0] * (0 not in frames) + [19] * (19 not in frames)
    seeds = [(t, PoseFit(at(0.0), right)) for t in starts]
    tracker.follow([*seeds, (frames[0], PoseFit(at(0.0, 180), right))])
    return [t for t, pose in enumerate(tracker.poses) if pose is not None and is_turned(pose)]


@pytest.mark.parametrize(("right", "turned"), [(0.1, range(0)), (0.001, range(6, 9))])
def test_a_short_turn_has_to_explain_far_more(rules, right, turned):
    assert turned_frames(rules, right, range(6, 9)) == [*turned]


def test_who_is_turned_in_most_frames_is_turned_in_all(rules):
    assert turned_frames(rules, 0.1, range(2, 20)) == [*range(20)]


def test_a_pose_is_given_up_where_the_cheapest_trajectory_cannot_lead_through_it(rules):
    rules.error = lambda t, pose: 0.4 if is_turned(pose) else 0.1  # eleven nats a frame
    tracker = tracker_of(20)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    rules.refined.clear()
    tracker.follow([(0, PoseFit(at(0.0, 180), 0.4))])
    assert {*rules.refined} == {1, 2, 3, 4}
    assert not any(pose is None or is_turned(pose) for pose in tracker.poses)


def test_in_a_poor_frame_the_limbs_are_searched(rules, monkeypatch):
    rules.error = lambda t, pose: 0.3 if t == 1 else 0.1
    monkeypatch.setattr(body_track, "move_limbs", lambda *given: PoseFit(at(0.3), 0.1))
    tracker = tracker_of(2)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    assert tracker.error[1] == 0.1
    assert places(tracker)[1] == pytest.approx(0.3)


@pytest.mark.parametrize(("error", "kept"), [(0.44, True), (0.46, False)])
def test_a_pose_that_explains_too_little_is_no_candidate(rules, error, kept):
    rules.error = lambda t, pose: error if t == 1 else 0.1
    tracker = tracker_of(3)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    assert (tracker.poses[1] is not None) == kept == np.isfinite(tracker.error[1])
    assert tracker.poses[2] is not None  # the frame is passed over


@pytest.mark.parametrize(("away", "again"), [(5, True), (6, False)])
def test_frames_without_anybody_are_passed_over_for_a_short_time(rules, away, again):
    tracker = tracker_of(away + 2)
    tracker.observations.there[1:-1] = False
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    assert (tracker.poses[-1] is not None) == again
    assert tracker.poses[1:-1] == [None] * away


def test_the_worst_frames_are_searched_but_not_beside_each_other(rules, monkeypatch):
    tried = []

    def find_pose(body, frame, settings):
        tried.append(frame.observation)
        return []

    monkeypatch.setattr(tracking, "find_pose", find_pose)
    tracker = tracker_of(30)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    for t, error in ((10, 0.4), (11, 0.39), (20, 0.3)):
        tracker._candidates[t] = [PoseFit(at(0.0), error)]
    tracker._decide()
    tracker.search_worst(5)
    assert tried == [10, 20]
    tracker.observations.there[9:12] = False  # nobody is searched where nobody is
    tracker.search_worst(5)
    assert tried == [10, 20, 20]
    # Where everything is improbable, nothing is worse than usual.
    tried.clear()
    for fits in tracker._candidates:
        fits[:] = [PoseFit(at(0.0), 0.3)]
    tracker._decide()
    tracker.search_worst(2)
    assert tried == [0, 4]


@pytest.mark.parametrize(("error", "moved"), [(0.2, False), (0.0001, True)])
def test_limbs_that_explain_less_are_no_candidates(rules, monkeypatch, error, moved):
    monkeypatch.setattr(tracking, "move_limbs", lambda *given: PoseFit(at(1.0), error))
    tracker = tracker_of(8)
    tracker.follow([(0, PoseFit(at(0.0), 0.1))])
    tracker.search_limbs()
    assert places(tracker)[7] == (1.0 if moved else 0.0)


def test_all_frames_are_fitted_together_in_blocks(monkeypatch):
    """Those decided before a block stay, and what explains less than usual counts for less."""
    calls = []

    def fit_trajectory(surface, frames, poses, floor, before):
        calls.append(([one.observation for one in frames], [p.root_m[0] for p in before]))
        calls[-1] += ({one.observation: one.scale for one in frames},)
        return [at(pose.root_m[0] + 0.5) for pose in poses]

    monkeypatch.setattr(tracking, "fit_trajectory", fit_trajectory)
    monkeypatch.setattr(tracking, "silhouette_error", lambda *given: 0.05)
    errors = np.full(100, 0.1)
    errors[[3, 7]] = 0.3, 0.05
    monkeypatch.setattr(tracking, "_BLOCK", 60)
    monkeypatch.setattr(tracking, "_AHEAD", 15)
    tracker = posed([at(0.001 * t) for t in range(100)], errors)
    tracker.smooth()
    assert places(tracker) == pytest.approx([0.001 * t + 0.5 for t in range(100)])
    assert (tracker.error == 0.05).all()
    assert [call[0] for call in calls] == [[*range(75)], [*range(60, 100)]]
    assert calls[0][1] == [] and calls[1][1] == pytest.approx([0.558, 0.559])
    scale = calls[0][2]
    assert (scale[3], scale[7], scale[8]) == pytest.approx((3.0, 1.0, 1.0))


def test_what_somebody_did_before_leaving_says_nothing_of_the_return(monkeypatch):
    befores = []

    def fit_trajectory(surface, frames, poses, floor, before):
        befores.append(len(before))
        return poses

    monkeypatch.setattr(tracking, "fit_trajectory", fit_trajectory)
    monkeypatch.setattr(tracking, "silhouette_error", lambda *given: 0.05)
    monkeypatch.setattr(tracking, "_BLOCK", 60)
    poses = [at(0.0)] * 60 + [None] * 30 + [at(0.0)] * 10
    tracker = posed(poses, np.array([np.inf if pose is None else 0.1 for pose in poses]))
    tracker.smooth()
    assert befores == [0, 0]
