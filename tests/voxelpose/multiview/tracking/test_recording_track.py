"""An improbable person is tracked again in silhouettes that were cut where it was found."""

from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import SilentReporter, StageClock
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.tracking import recording_track
from voxelpose.multiview.tracking.recording_track import TrackWork

RIG = Rig((look_at("cam", (3, 0, 1), (0, 0, 1), (8, 6)),))
RIGHT, WRONG = 0.08, 0.4


def silhouettes(rows):
    """Recording of two frames whose silhouettes fill so many rows."""
    mask = np.zeros((6, 8), bool)
    mask[:rows] = True
    source = SimpleNamespace(silhouettes_given=False)
    return SimpleNamespace(
        store=[[mask], [mask]], rig=RIG, footage=SimpleNamespace(source=source), rows=rows
    )


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


@pytest.fixture
def result(monkeypatch):
    """What comes of a person tracked with an error, and again with others."""

    @contextmanager
    def cut(prepared, *_):
        yield silhouettes(3)

    monkeypatch.setattr(recording_track, "cut_by_bodies", cut)

    def result(first, *again, background="auto", at_m=None):
        settings, told = Settings(background=background), (StageClock(), SilentReporter())
        work, errors = TrackWork(settings, 10, MatchSettings(), None, *told), list(again)

        def followed(errors, at_m=None):
            errors = errors if isinstance(errors, tuple) else (errors,)
            return [tracked(error, at_m) for error in errors]

        with ExitStack() as kept:
            at = followed(first), silhouettes(4), lambda _: followed(errors.pop(0), at_m), kept
            found, changed = work.cut_anew(*at)
        people = tuple(float(tracker.error[0]) for tracker, _ in found)
        return people if len(people) > 1 else people[0], changed, len(errors)

    return result


def test_a_probable_person_is_left_alone(result):
    assert result(RIGHT, 0.01) == (RIGHT, {}, 1)


def test_an_improbable_one_is_tracked_again_and_the_more_probable_taken(result):
    assert result(WRONG, RIGHT, 0.01) == (RIGHT, {"cam": 0.25}, 1)
    assert result(WRONG, 0.5, 0.01) == (WRONG, {}, 1)


def test_of_several_people_all_are_tracked_again_where_one_is_improbable(result):
    assert result((RIGHT, WRONG), (0.09, RIGHT), 0.01) == ((0.09, RIGHT), {"cam": 0.25}, 1)
    assert result((RIGHT, RIGHT), 0.01) == ((RIGHT, RIGHT), {}, 1)
    assert result((RIGHT, WRONG), (WRONG, WRONG), 0.01) == ((RIGHT, WRONG), {}, 1)


def test_it_is_cut_twice_at_most(result):
    assert result(WRONG, 0.35, 0.3, 0.01) == (0.3, {"cam": 0.25}, 1)


def test_where_both_agree_the_first_stands(result):
    assert result(WRONG, RIGHT, at_m=WRONG + 0.01) == (WRONG, {}, 0)
    assert result(WRONG, RIGHT, at_m=WRONG + 0.03) == (RIGHT, {"cam": 0.25}, 0)


def test_the_papers_silhouettes_stay_as_they_are(result):
    assert result(WRONG, RIGHT, background="paper") == (WRONG, {}, 1)


def test_one_of_several_people_is_supposed_where_the_place_is_known():
    """As in the nearest frame, moved; not where nobody is, and of one person nowhere."""
    pose = Pose(np.array([1.0, 2, 0.9]), np.eye(3), np.zeros(3))
    places_m = np.array([[1.0, 2, 1], [1.2, 2, 1], [1.5, 2, 1], [np.nan] * 3])
    there = ~np.isnan(places_m[:, 0])
    seen = SimpleNamespace(places_m=places_m, there=there)
    poses = [pose, None, None, None]
    found = recording_track._supposed(SimpleNamespace(poses=poses, observations=seen))
    assert found[3] is None
    assert [one.root_m[0] for one in found[:3]] == pytest.approx([1.0, 1.2, 1.5])
    alone = SimpleNamespace(places_m=None, there=np.ones(4, bool))
    assert recording_track._supposed(SimpleNamespace(poses=poses, observations=alone)) is poses


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
