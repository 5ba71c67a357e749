"""The tracker's decisions, where rules stand for silhouettes: see `Rules`."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.motion.dynamics import MOMENTUM
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import fitting_model, stance
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import PoseFit
from voxelpose.multiview.tracking import body_track, tracking
from voxelpose.multiview.tracking.tracking import PoseTracker

MODEL = fitting_model()


def at(x_m: float, yaw_deg: float = 0.0) -> Pose:
    step = np.zeros(6 + MODEL.dof_count)
    step[5] = np.radians(yaw_deg)
    return stance(MODEL, place_m=(x_m, 0.0)).moved(step)


class Frames:
    """An observation per frame: its number."""

    def __init__(self, count: int):
        self._count, self.there = count, np.ones(count, np.bool_)

    def __len__(self) -> int:
        return self._count

    def observe(self, t, near_m):
        return SimpleNamespace(observation=t, grid=None, occupancy=None)


class Rules:
    """What the searches find; by default a refinement ends at its prior, and nothing else is done.

    Attributes:
        error: of a refined pose, by frame.
        priors: that refinements were given.
    """

    def __init__(self, monkeypatch, error: float = 0.1):
        self.error = dict.fromkeys(range(100), error)
        self.priors = []
        for module, name in (
            (body_track, "refine_fit"),
            (tracking, "refine_fit"),
            (body_track, "move_limbs"),
            (tracking, "find_pose"),
        ):
            monkeypatch.setattr(module, name, getattr(self, name))

    def refine_fit(self, body, observation, start, prior, settings):
        self.priors.append(prior)
        return PoseFit(prior.pose, self.error[observation])

    def move_limbs(self, body, observation, fit):
        raise AssertionError("limbs are moved in a frame that is not poor")

    def find_pose(self, body, frame, settings, count):
        raise AssertionError("a search without a prior")


@pytest.fixture
def rules(monkeypatch) -> Rules:
    return Rules(monkeypatch)


def tracker_of(poses: list[Pose | None], error: float = np.inf, fps: float = 30.0) -> PoseTracker:
    body = SimpleNamespace(model=MODEL, body_volume=None)
    settings = fps, MatchSettings()
    frames = Frames(len(poses))
    tracker = PoseTracker(body, frames, *settings, lambda _: nullcontext(), lambda: None)  # type: ignore[arg-type]
    tracker.poses = list(poses)
    tracker.error[[pose is not None for pose in poses]] = error
    return tracker


def search_in_vain(monkeypatch) -> None:
    """Lets searches in poor frames end where they began."""
    monkeypatch.setattr(body_track, "move_limbs", lambda *given: given[2])


def places(tracker: PoseTracker) -> list[float | None]:
    return [None if pose is None else pose.root_m[0] for pose in tracker.poses]


def test_every_pose_is_polished_toward_the_middle_of_its_neighbours(rules):
    tracker = tracker_of([at(0.0), at(0.5), at(0.2), at(0.8)], 0.1)
    tracker.polish()
    assert places(tracker) == pytest.approx([0.0, 0.1, 0.65, 0.8])


def test_at_twice_the_frame_rate_steps_are_half_as_long(rules):
    for fps in (30.0, 60.0):
        tracker_of([at(0.0)], 0.1, fps).polish()
    np.testing.assert_allclose(rules.priors[1].sigma, 0.5 * rules.priors[0].sigma)


def test_tracking_goes_both_ways_and_expects_the_last_step_again(rules):
    tracker = tracker_of([None, at(0.0), at(0.1), None, None], 0.1)
    tracker.carry(2)
    first = 0.1 + 0.1 * MOMENTUM
    assert places(tracker)[2:] == pytest.approx([0.1, first, first + 0.1 * MOMENTUM**2])
    tracker.carry(1)
    assert places(tracker)[:2] == pytest.approx([-0.1 * MOMENTUM, 0.0])


@pytest.mark.parametrize(("found", "kept"), [(0.099, False), (0.09, True)])
def test_a_pose_that_is_hardly_better_ends_the_tracking(rules, found, kept):
    rules.error = dict.fromkeys(range(3), found)
    tracker = tracker_of([at(0.0), at(0.3), at(0.3)], 0.1)
    tracker.carry(0)
    assert places(tracker)[1] == pytest.approx(0.0 if kept else 0.3)


@pytest.mark.parametrize(("start", "direction", "usual"), [(11, +1, 0.4), (12, -1, 0.1)])
def test_the_usual_error_is_that_of_the_frames_tracked_before(start, direction, usual):
    tracker = tracker_of([at(0.0)] * 24)
    tracker.error[:] = np.repeat([0.4, 0.1], 12)
    track = tracker._track_at(start, direction)
    assert track is not None
    assert track.usual == usual
    assert len(track.errors) == 12


def test_in_a_poor_frame_the_limbs_are_searched(rules, monkeypatch):
    rules.error[1] = 0.3
    monkeypatch.setattr(body_track, "move_limbs", lambda *given: PoseFit(at(0.3), 0.1))
    tracker = tracker_of([at(0.0), None], 0.1)
    tracker.carry(0)
    assert tracker.error[1] == 0.1
    assert places(tracker)[1] == pytest.approx(0.3)


@pytest.mark.parametrize(("found", "kept"), [(0.44, True), (0.46, False)])
def test_a_pose_that_explains_too_little_is_not_kept(rules, monkeypatch, found, kept):
    rules.error[1] = found
    search_in_vain(monkeypatch)
    tracker = tracker_of([at(0.0), None], 0.1)
    tracker.carry(0)
    assert (tracker.poses[1] is not None) == kept


@pytest.mark.parametrize(("found", "better"), [(0.099, False), (0.05, True)])
def test_an_anchor_has_to_be_better_than_what_is_there(rules, monkeypatch, found, better):
    monkeypatch.setattr(tracking, "find_pose", lambda *given: [PoseFit(at(1.0), found)])
    tracker = tracker_of([at(0.0)], 0.1)
    assert tracker.anchor(0) == better
    assert places(tracker) == [1.0 if better else 0.0]


@pytest.mark.parametrize(("found", "better"), [(0.2, False), (0.05, True)])
def test_limbs_that_explain_less_are_not_moved(rules, monkeypatch, found, better):
    monkeypatch.setattr(body_track, "move_limbs", lambda *given: PoseFit(at(1.0), found))
    tracker = tracker_of([at(0.0)] * 8, 0.1)
    tracker.recheck()
    assert places(tracker)[4] == (1.0 if better else 0.0)


def test_the_worst_frames_are_repaired_but_not_beside_each_other(rules, monkeypatch):
    tried = []
    monkeypatch.setattr(tracking, "find_pose", lambda *given: tried.append(given[1].observation))
    tracker = tracker_of([at(0.0)] * 30, 0.1)
    tracker.error[[10, 11, 20]] = 0.4, 0.39, 0.3
    tracker.repair(5)
    assert tried == [10, 20]
    tracker.observations.there[9:12] = False  # nobody is searched where nobody is
    tracker.repair(5)
    assert tried == [10, 20, 20]


@pytest.mark.parametrize("turned", [range(7, 10), range(3)])
def test_the_short_stretch_beside_a_jump_is_tracked_again(rules, turned):
    rules.error = dict.fromkeys(range(10), 0.12)
    tracker = tracker_of([at(0.0, 180.0 if t in turned else 0.0) for t in range(10)], 0.12)
    tracker.mend_jumps()
    assert all(pose.root_rotation[0, 0] == pytest.approx(1) for pose in tracker.poses)


def test_a_stretch_that_explains_more_than_its_neighbours_would_stays(rules, monkeypatch):
    rules.error = dict.fromkeys(range(10), 0.3)
    search_in_vain(monkeypatch)
    before = [at(0.0, 180.0 * (t > 6)) for t in range(10)]
    tracker = tracker_of(before, 0.12)
    tracker.mend_jumps()
    assert tracker.poses == before


def test_a_body_that_is_elsewhere_in_the_next_frame_has_not_jumped(rules):
    before = [at(0.5 * (t > 6)) for t in range(10)]
    tracker = tracker_of(before, 0.12)
    tracker.mend_jumps()
    assert tracker.poses == before


@pytest.mark.parametrize(("fps", "jumps"), [(30.0, False), (60.0, True)])
def test_what_is_a_jump_depends_on_the_time_between_frames(rules, fps, jumps):
    """The joints move by 7 cm in the mean: 2 or 4 metres per second."""
    tracker = tracker_of([at(0.0, 23.0 * (t > 6)) for t in range(10)], 0.12, fps)
    tracker.mend_jumps()
    assert (tracker.poses[9].root_rotation[0, 0] == pytest.approx(1)) == jumps
