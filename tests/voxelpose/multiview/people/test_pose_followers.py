"""Several people followed live, each beside the others."""

from concurrent.futures import Executor, Future
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.follower import AtOnce
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    joint_errors_m,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.people import pose_followers
from voxelpose.multiview.people.pose_followers import PoseFollowers
from voxelpose.multiview.people.presence import PeopleSets
from voxelpose.multiview.proposers.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.tracking.body_track import BodyTrack, Moment
from voxelpose.multiview.tracking.follower import PoseFollower, search

VIEWS = views(4, (240, 240))
BODIES = other_body(3, "female"), other_body(4, "male")
GEOMETRIES = [BodyGeometry.from_surface(Surface(body), 0.05, "cpu") for body in BODIES]
WALKS = {"left_thigh.flexion": 30.0, "right_thigh.flexion": -15.0, "left_upper_arm.forward": 25.0}


class Never(Executor):
    """Notes what is submitted, and never does it."""

    def __init__(self):
        self.asked = []

    def submit(self, fn, /, *args, **kwargs):
        self.asked.append(fn)
        return Future()


def passing(frame: int) -> list[Pose]:
    """Two who walk toward each other and past, 0.6 m apart, at 1 m/s and ten frames a second."""
    x_m = 0.1 * frame - 0.4
    places = ((x_m, -0.3), (-x_m, 0.3))
    return [stance(body, WALKS, at) for body, at in zip(BODIES, places, strict=True)]


def moment(time_s: float, *people: tuple[BodyModel, Pose]) -> Moment:
    """Silhouettes of some people together."""
    seen = zip(*(photograph(VIEWS, *one) for one in people), strict=True)
    masks = [np.logical_or.reduce(both) for both in seen]
    return Moment.of(time_s, dict(zip(VIEWS.rig.names, masks, strict=True)))


def track(person: int, pose: Pose) -> BodyTrack:
    return BodyTrack(GEOMETRIES[person], 0.0, PoseFit(pose, 0.05))


def followed(executor: Executor, poses: list[Pose | None]) -> PoseFollowers:
    """Both followed from these poses on."""
    follower = PoseFollowers(VIEWS.rig, Settings(), 2, executor)
    for k, (one, pose) in enumerate(zip(follower.people, poses, strict=True)):
        one._track = None if pose is None else track(k, pose)
    return follower


def test_two_who_walk_past_each_other_keep_their_numbers():
    follower = followed(Never(), [*passing(0)])
    for frame in range(1, 9):
        found = follower.step(moment(frame / 10, *zip(BODIES, passing(frame), strict=True)))
        for body, pose, person in zip(BODIES, passing(frame), found, strict=True):
            assert person is not None and person.fit.error < 0.1
            assert joint_errors_m(person.model, person.fit.pose, body, pose).mean() < 0.05


def test_one_person_is_followed_as_ever():
    (pose, _), seen = passing(0), moment(0.1, (BODIES[0], passing(1)[0]))
    alone = PoseFollower(VIEWS.rig, Settings(), Never())
    people = PoseFollowers(VIEWS.rig, Settings(), 1, Never())
    alone._track = people.people[0]._track = track(0, pose)
    (found,), fit = people.step(seen), alone.step(seen)
    assert fit is not None and found is not None and found.moment is seen
    assert np.array_equal(found.fit.pose.angles_rad, fit.pose.angles_rad)
    assert np.array_equal(found.fit.pose.root_m, fit.pose.root_m) and found.visibility.all()


def test_who_is_not_there_is_not_searched_for():
    """What is left of the other's silhouette is nobody."""
    executor = Never()
    follower = followed(executor, [passing(0)[0], None])
    for frame in range(1, 4):
        first, second = follower.step(moment(frame, (BODIES[0], passing(0)[0])))
        assert first is not None and second is None
    assert search not in executor.asked


@pytest.mark.slow
def test_both_are_found_where_they_stand():
    follower = PoseFollowers(VIEWS.rig, Settings(), 2, AtOnce())
    for frame in range(2):
        found = follower.step(moment(frame / 30, *zip(BODIES, passing(0), strict=True)))
    places = np.array([person.fit.pose.root_m for person in found if person is not None])
    true = np.array([pose.root_m for pose in passing(0)])
    apart = np.linalg.norm(places[:, None] - true, axis=2)
    assert len(places) == 2 and apart.min(axis=1).max() < 0.15
    assert len(set(apart.argmin(axis=1))) == 2


@pytest.fixture
def sees(monkeypatch):
    """Where the hull shows people, as the test says: a list of places, and whether upright."""
    told = {"axes": [], "upright": []}

    def sets(self, masks, most):
        count = len(told["axes"])
        members = [np.arange(count)]
        axes = np.array(told["axes"], float).reshape(count, 2)
        return PeopleSets(axes, np.array(told["upright"], bool), members, np.zeros(1))

    monkeypatch.setattr(pose_followers.PresenceSearch, "sets", sets)
    return told


def places_of(follower: PoseFollowers) -> list[tuple[float, float] | None]:
    pairs = zip(follower._there.tolist(), follower._places_m.tolist(), strict=True)
    return [tuple(place) if there else None for there, place in pairs]


def test_who_comes_in_gets_the_free_number(sees):
    """A place beside somebody who is followed is that person's, and who lies is nobody."""
    follower = followed(Never(), [None, passing(0)[1]])
    sees |= {"axes": [(0.5, 0.1), (-0.4, -0.3), (0, 2)], "upright": [True, True, False]}
    follower.step(moment(0.1, *zip(BODIES, passing(0), strict=True)))
    assert places_of(follower)[0] == (-0.4, -0.3)


def test_two_who_were_lost_have_their_numbers_by_their_places(sees):
    seen = moment(1.0, *zip(BODIES, passing(0), strict=True))
    for order in ([0, 1], [1, 0]):
        follower = followed(Never(), [None, None])
        for k, place in enumerate(((-0.4, -0.3), (0.4, 0.3))):
            follower._note(k, np.array(place), 0.9)
        axes = [(-0.35, -0.3), (0.45, 0.3)]
        sees |= {"axes": [axes[k] for k in order], "upright": [True, True]}
        follower.step(seen)
        assert places_of(follower) == axes
    sees |= {"axes": [], "upright": []}
    for time_s, there in ((2.9, True), (3.1, False)):  # who is hidden is still there for a while
        follower.step(moment(time_s, *zip(BODIES, passing(0), strict=True)))
        assert [place is not None for place in places_of(follower)] == [there, there]


@pytest.mark.parametrize(("cameras", "shown"), [(4, 0.0), (3, 0.5), (2, 1.0), (0, 1.0)])
def test_a_joint_needs_two_cameras_that_see_it(cameras, shown):
    fit = PoseFit(passing(4)[0], 0.1)
    one = SimpleNamespace(step=lambda seen: fit, body=GEOMETRIES[0])
    names = VIEWS.rig.names
    masks = {name: np.zeros((240, 240), bool) for name in names}
    unknown = {name: np.full((240, 240), k < cameras) for k, name in enumerate(names)}
    found = pose_followers._found(one, Moment.of(0.0, masks, unknown), VIEWS.rig)  # type: ignore[arg-type]
    assert found is not None and (found.visibility == shown).all()
