"""Two people followed beside each other, from silhouettes to motion."""

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace as namespace

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.progress import SilentReporter, StageClock
from silhouette_core.scoring.cpu import CpuBackend
from tests.sources import GreySource
from tests.voxelpose.multiview.matching_scenes import other_body, photograph, stance, views
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.multiview_estimator import MultiViewEstimator
from voxelpose.multiview.people.people_track import PeopleTrack, people_places
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    PreparationSettings,
    prepare_silhouettes,
)

ROBOT = Path(__file__).parents[4] / "examples" / "bodies" / "robot_arm.urdf"
PLACES = (-0.35, 0.0), (0.4, 0.15)
TURNS = (
    {"left_upper_arm.abduction": 40.0, "left_thigh.flexion": 25.0, "right_forearm.flexion": 50.0},
    {"right_upper_arm.forward": 60.0, "right_thigh.flexion": 30.0, "right_shin.flexion": 40.0},
)


class Noting(SilentReporter):
    """Keeps what is told."""

    def __init__(self):
        self.told = []

    def note(self, words):
        self.told.append(words)


class Couple(GreySource):
    """Silhouettes of two people, who stand."""

    def at(self, steps):
        for _ in steps:
            pairs = zip(*(photograph(VIEWS, *one) for one in PEOPLE), strict=True)
            names = self.rig.names
            yield {
                name: np.repeat(255 * (a | b)[..., None].astype(np.uint8), 3, axis=2)
                for name, (a, b) in zip(names, pairs, strict=True)
            }


VIEWS = views(5, (240, 240))
BODIES = other_body(3, "female"), other_body(4, "male")
PEOPLE = [
    (body, stance(body, turns, place))
    for body, turns, place in zip(BODIES, TURNS, PLACES, strict=True)
]


@pytest.fixture(scope="module")
def source():
    return Couple(VIEWS.rig, 2, silhouettes_given=True)


def tracker_of(model, pose):
    """A tracker, as far as its body is drawn."""
    body = namespace(model=model, body_volume=namespace(backend=CpuBackend()))
    return namespace(body=body, poses=[pose])


@pytest.mark.slow
def test_two_people_are_followed_beside_each_other(source):
    """Each is where one of them stands, joints to 45 mm about the pelvis, in every frame."""
    estimator, settings = MultiViewEstimator(), Settings(stature_m=1.2, smooth=False)
    found = estimator.estimate_people(source, settings, SilentReporter(), None)
    assert len(found) == 2
    true = np.stack([joints_of(body, [pose])[0] for body, pose in PEOPLE])
    met = []
    for estimate in found:
        motion = estimate.motion
        assert motion.frames.tolist() == [0, 1]
        joints = motion.landmarks()
        apart = np.linalg.norm(joints[:, 0, None, :2] - true[None, :, 0, :2], axis=2)
        met.append(int(apart[0].argmin()))
        off = (joints - joints[:, :1]) - (true[met[-1]] - true[met[-1], 0])
        assert 1000 * np.linalg.norm(off, axis=2).mean() < 45
        assert estimate.facts["stature_given"] is False
    assert sorted(met) == [0, 1]


def test_more_people_than_there_are_cannot_be_followed(source):
    with pytest.raises(InputError, match="3 people were asked for, and 2 at most are seen apart"):
        MultiViewEstimator().estimate_people(source, Settings(), SilentReporter(), 3)


def test_two_cameras_do_not_tell_people_apart():
    source = Couple(VIEWS.rig.select(["cam_1", "cam_3"]), 2, silhouettes_given=True)
    with pytest.raises(InputError, match="2 cameras are too few to tell 2 people apart"):
        MultiViewEstimator().estimate_people(source, Settings(), SilentReporter(), 2)


def test_two_robots_cannot_be_followed(source):
    settings = Settings(options={"body": str(ROBOT)})
    with pytest.raises(InputError, match="no person's cannot be followed"):
        MultiViewEstimator().estimate_people(source, settings, SilentReporter(), 2)


def test_what_nobody_explains_is_said_where_it_is_as_large_as_a_person():
    trackers = [tracker_of(body, pose) for body, pose in PEOPLE]
    people = zip(*(photograph(VIEWS, *one) for one in PEOPLE), strict=True)
    volume = VoxelGrid.from_bounds((-1.5, -1.5, 0), (1.5, 1.5, 2), 0.05)
    observer = namespace(views=VIEWS, volume=volume)
    prepared = namespace(store=[[a | b for a, b in people]], observer=observer)
    places_m = np.zeros((2, 1, 3)), np.zeros((0, 1, 3))
    track = PeopleTrack([namespace()], prepared, *places_m, ExitStack())
    assert track._unexplained(trackers) == 0
    assert track._unexplained(trackers[:1]) == 1


def test_a_thing_is_seen_where_its_hull_is_beside_the_bodies():
    trackers = [tracker_of(body, pose) for body, pose in PEOPLE[:1]]
    people = zip(*(photograph(VIEWS, *one) for one in PEOPLE), strict=True)
    volume = VoxelGrid.from_bounds((-1.5, -1.5, 0), (1.5, 1.5, 2), 0.05)
    observer = HullObserver(VIEWS, volume, 0.025, body_rule(5, 0))
    unseen = namespace(people_masks=lambda t: [[]] * 5)
    prepared = namespace(store=[[a | b for a, b in people]], observer=observer, footage=unseen)
    places = [np.array([[(*place, 1.0)]]) for place in PLACES]
    track = PeopleTrack([namespace()], prepared, *places, ExitStack())
    ((body, thing),) = track._drawn_pieces(trackers)
    own, other = (photograph(VIEWS, *one) for one in PEOPLE)
    for k in range(5):
        assert np.array_equal(body[k], own[k])
        assert (thing[k] & other[k]).sum() > 0.9 * other[k].sum()


class Wardrobe(Couple):
    """Two people in colours, of whom the second is away for more than two seconds."""

    def backgrounds(self):
        return {camera.name: [np.full((*camera.size, 3), 90, np.uint8)] for camera in self.rig}

    def at(self, steps):
        for t in steps:
            pairs = zip(*(photograph(VIEWS, *one) for one in PEOPLE), strict=True)
            pictures = {}
            for name, (first, second) in zip(self.rig.names, pairs, strict=True):
                picture = np.full((*first.shape, 3), 90, np.uint8)
                picture[first] = 0, 0, 200
                if not 5 <= t < 29:
                    picture[second & ~first] = 200, 0, 0
                pictures[name] = picture
            yield pictures


def test_who_comes_back_is_the_same_person_and_that_is_said():
    source = Wardrobe(VIEWS.rig, 34, fps=10.0)
    reporter = Noting()
    with prepare_silhouettes(
        source, Settings(), PreparationSettings(0.03, 0, "off"), StageClock(), reporter
    ) as prepared:
        places_m, things_m = people_places(prepared, None, StageClock(), reporter)
    assert not len(things_m)
    there = np.isfinite(places_m[:, :, 0])
    assert there[0].all()
    assert there[1].tolist() == [not 5 <= t < 29 for t in range(34)]
    assert any("person 2 is away from frame 4 to 29" in words for words in reporter.told)
