"""How many people there are, and where, by their hull."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.people import number_of_people
from voxelpose.multiview.people.presence import (
    PeopleSets,
    PresenceSearch,
    at_all_times,
    blind_to_people,
    find_people,
    frames_of_nobody,
    join_tracks,
    likeliest_sets,
    link_sets,
)

VOLUME = VoxelGrid.from_bounds((-1.5, -1.5, -0.05), (1.5, 1.5, 2.1), 0.05)


@pytest.mark.parametrize("told", ["0", "7", "auto", "two"])
def test_a_number_of_people_is_told_or_refused(told):
    assert number_of_people("6", auto=False) == 6 and number_of_people("auto") is None
    with pytest.raises(InputError, match=f"--people {told} .*: give 1 to 6$"):
        number_of_people(told, auto=False)


def union(*silhouettes):
    return [np.logical_or.reduce(masks) for masks in zip(*silhouettes, strict=True)]


def search(seen_by):
    return PresenceSearch(observer(seen_by))


def observer(seen_by):
    return HullObserver(seen_by, VOLUME, 0.025, body_rule(len(seen_by.rig), 0))


@pytest.mark.parametrize("cameras", [3, 4, 6])
def test_people_and_not_the_phantoms_between_them(cameras):
    """Pieces of hull that no silhouette needs are nobody."""
    seen_by, places = views(cameras), ((-0.55, 0.1), (0.5, -0.2), (0.0, 0.9))
    bodies = fitting_model(), other_body(), other_body(5, "male")
    people = [
        photograph(seen_by, body, stance(body, {}, place))
        for body, place in zip(bodies, places, strict=True)
    ]
    sets = search(seen_by).sets(union(*people), 6)
    if cameras == 3:
        assert len(sets.axes_m) > 3
    found = sets.axes_m[sets.members[0]]
    assert len(found) == 3
    apart = np.linalg.norm(found[:, None] - np.array(places)[None], axis=2)
    assert apart.min(axis=1).max() < 0.15 and len(set(apart.argmin(axis=1))) == 3
    fewer = search(seen_by).sets(union(*people), 2)  # as many as the pose network sees
    assert max(map(len, fewer.members)) == 2


def test_one_person_with_arms_and_legs_apart_is_one():
    model, seen_by = fitting_model(), views(4)
    apart = {f"{side}_upper_arm.abduction": 90.0 for side in ("left", "right")}
    apart |= {"left_thigh.flexion": 60.0, "right_thigh.flexion": -20.0}
    sets = search(seen_by).sets(photograph(seen_by, model, stance(model, apart)), 6)
    assert len(sets.members[0]) == 1


def post(seen_by, x, y, width_m=0.05, height_m=1.2):
    """Silhouettes of a post that stands on the floor."""
    half = 0.5 * width_m
    corners = [
        (x + a, y + b, z) for a in (-half, half) for b in (-half, half) for z in (0, height_m)
    ]
    masks = []
    for camera in seen_by.rig:
        pixels, _ = camera.project(np.array(corners))
        mask = np.zeros(camera.size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, cv2.convexHull(pixels.round().astype(np.int32)), 1)
        masks.append(mask.view(bool))
    return masks


def test_where_somebody_was_before_is_asked_for_too():
    """The hull of two who stand near to each other may be thickest in one place only."""
    seen_by = views(4)
    near = union(*(post(seen_by, 0, y, 0.3, 1.6) for y in (-0.17, 0.17)))
    presence = search(seen_by)
    alone = presence.sets(near, 6).axes_m
    before_m = np.array([[0.0, -0.3], [0.0, 0.3], [1.2, 1.2]])
    asked = presence.sets(near, 6, before_m).axes_m
    assert len(alone) == 1 and len(asked) == 3
    assert np.linalg.norm(asked - before_m[1], axis=1).min() < 0.05


def test_what_is_much_thinner_than_a_person_is_nobody():
    model, seen_by = fitting_model(), views(4)
    person = photograph(seen_by, model, stance(model))
    sets = search(seen_by).sets(union(person, post(seen_by, 0.9, 0.3)), 6)
    assert len(sets.axes_m) > 1  # it is asked for
    assert len(sets.members[0]) == 1


def test_somebody_who_lies_is_not_taken_for_several():
    model, seen_by = fitting_model(), views(4)
    lying = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
    pose = Pose(np.array([0.0, 0, 0.15]), lying, stance(model).angles_rad)
    sets = search(seen_by).sets(photograph(seen_by, model, pose), 6)
    assert len(sets.members[0]) == 0


def test_nobody_is_nobody():
    seen_by = views(3)
    empty = [np.zeros(camera.size[::-1], bool) for camera in seen_by.rig]
    people, things = find_people(observer(seen_by), [empty] * 2, np.arange(2.0), [6] * 2)
    assert not len(people) and not len(things)


def test_people_keep_their_numbers_while_they_walk_past_each_other():
    seen_by, bodies = views(4), (fitting_model(), other_body())
    frames, times_s, y = [], np.arange(8) / 10, (-0.3, 0.3)
    x = np.linspace(-0.7, 0.7, 8)
    for k in range(8):
        poses = stance(bodies[0], {}, (x[k], y[0])), stance(bodies[1], {}, (-x[k], y[1]))
        frames.append(
            union(*(photograph(seen_by, *one) for one in zip(bodies, poses, strict=True)))
        )
    found, _ = find_people(observer(seen_by), frames, times_s, [6] * len(frames))
    assert found.shape == (2, 8, 2)
    for track in found:
        ahead = np.sign(track[-1, 0] - track[0, 0])
        line = np.stack([ahead * x, np.full(8, y[0] if ahead > 0 else y[1])], axis=1)
        assert np.linalg.norm(track - line, axis=1).max() < 0.15


def sets_of(axes, table):
    """A frame in which these sets of people who stand are possible, as {members: cost}."""
    members = [np.array(one, np.int64) for one in table]
    stand = np.full(len(axes), True)
    return PeopleSets(np.array(axes, float), stand, members, np.array(list(table.values())))


def test_time_decides_what_a_frame_leaves_open():
    """A phantom explains one frame better than the person, and is nowhere before and after."""
    true = sets_of([(0, 0)], {(0,): 0.2, (): 1.0})
    doubtful = sets_of([(0, 0), (1.5, 0)], {(1,): 0.1, (0,): 0.3, (): 1.0})
    frames, elapsed_s = [true, doubtful, true], np.array([0.1, 0.1])
    taken = likeliest_sets(frames, elapsed_s)
    assert [frame.members[k].tolist() for frame, k in zip(frames, taken, strict=True)] == [[0]] * 3
    (track,), _ = link_sets(frames, taken, elapsed_s)
    assert not track.any()


def test_somebody_who_runs_is_kept():
    """Most of the silhouette is hidden by others', and 2.5 m/s are run."""
    frames = [sets_of([(0.25 * k, 0)], {(0,): 0.2, (): 0.55}) for k in range(10)]
    assert likeliest_sets(frames, np.full(9, 0.1)) == [0] * 10


def test_who_crouches_is_somebody_and_what_is_low_at_all_times_nobody():
    seen_by, times_s = views(4), np.arange(3) / 10
    low, high = (post(seen_by, 0.3, 0.2, 0.4, height_m) for height_m in (0.8, 1.6))
    (person,), _ = find_people(observer(seen_by), [low, high, high], times_s, [6] * 3)
    np.testing.assert_allclose(person, [(0.3, 0.2)] * 3, atol=0.1)
    for frames in ([low] * 3, [low, high, low]):
        people, (thing,) = find_people(observer(seen_by), frames, times_s, [6] * len(frames))
        assert not len(people)
        np.testing.assert_allclose(thing, person)


def test_a_crate_is_nobody_wherever_the_volume_begins():
    seen_by, times_s = views(4), np.arange(3) / 10
    deep = VoxelGrid.from_bounds((-1.5, -1.5, -0.4), (1.5, 1.5, 2.1), 0.05)
    asked = HullObserver(seen_by, deep, 0.025, body_rule(4, 0))
    person = photograph(seen_by, fitting_model(), stance(fitting_model(), {}, (-0.4, 0)))
    both = union(person, post(seen_by, 0.6, 0.2, 0.4, 0.8))
    people, things = find_people(asked, [both] * 3, times_s, [6] * 3)
    assert len(people) == len(things) == 1
    np.testing.assert_allclose(things[0], [(0.6, 0.2)] * 3, atol=0.1)


def test_who_stays_for_a_moment_only_is_not_there():
    alone = sets_of([(0, 0)], {(0,): 0.2, (): 1.0})
    ghost = sets_of([(0, 0), (1.5, 0)], {(0, 1): 0.1, (0,): 0.9, (): 2.0})
    frames, elapsed_s = [alone, ghost, alone], np.array([0.1, 0.1])
    taken = likeliest_sets(frames, elapsed_s)
    assert len(link_sets(frames, taken, elapsed_s)[0]) == 1


def test_somebody_hidden_for_a_while_is_the_same_person():
    times_s = np.arange(40) / 10
    first, again = np.full((40, 2), np.nan), np.full((40, 2), np.nan)
    first[:10], again[20:] = (0.0, 0.0), (0.5, 0.0)
    (person,) = join_tracks(np.stack([again, first]), times_s)
    np.testing.assert_allclose(person[15], (0.25, 0.0), atol=0.05)
    away = again + np.array([3.0, 0.0])
    assert len(join_tracks(np.stack([first, away]), times_s)) == 2
    late = np.full((40, 2), np.nan)
    late[35:] = (0.0, 0.0)
    assert len(join_tracks(np.stack([first, late]), times_s)) == 2


def test_places_between_the_moments_that_were_asked():
    asked = np.array([[[0.0, 0.0], [1.0, 2.0], [np.nan, np.nan]]])
    (places,) = at_all_times(asked, np.array([0.0, 0.2, 0.4]), np.array([0.0, 0.1, 0.2, 0.3]))
    np.testing.assert_allclose(places[:3], [[0, 0], [0.5, 1], [1, 2]])
    assert np.isnan(places[3]).all()


@dataclass
class Prepared:
    """Silhouettes of one body in frame 11 of three, less of it in 12, nobody in 10."""

    observer: HullObserver
    store: list
    network: int | None = None
    estimated: np.ndarray = field(default_factory=lambda: np.zeros(4, bool))

    numbers = np.array([10, 11, 12])

    @property
    def footage(self):
        return SimpleNamespace(people=self.network, people_counted=lambda t: self.network)


def test_frames_in_which_nobody_is_seen_are_told():
    seen_by, body = views(4), fitting_model()
    whole = photograph(seen_by, body, stance(body, {}))
    nobody = [np.zeros_like(mask) for mask in whole]
    in_one = [whole[0], *nobody[1:]]
    prepared = Prepared(observer(seen_by), [nobody, whole, in_one])
    # Who is seen by a single camera is not found, and yet not away.
    assert frames_of_nobody(prepared) == {10}
    specks = [mask.copy() for mask in nobody]
    specks[1][:4, :4] = True
    assert frames_of_nobody(replace(prepared, store=[specks, whole, whole])) == {10}
    # Silhouettes miss somebody whom the network sees,
    assert frames_of_nobody(replace(prepared, network=1)) == frozenset()
    # and who stands still is part of a background that is estimated, but for the network.
    unsure = replace(prepared, estimated=np.ones(4, bool))
    assert frames_of_nobody(unsure) == frozenset()
    assert frames_of_nobody(replace(unsure, network=0)) == {10}


def test_a_camera_whose_network_misses_somebody_who_stands_still_tells_nothing():
    seen_by, body = views(4), fitting_model()
    left, right = (photograph(seen_by, body, stance(body, {}, (x, 0.0))) for x in (-0.6, 0.6))
    masks = [[a, b] for a, b in zip(left, right, strict=True)]
    masks[2] = [right[2]]
    footage = SimpleNamespace(people=True, people_masks=lambda t: masks)
    estimated = np.array([True, True, True, False])
    late = np.array([[False, False, False, True]])
    prepared = SimpleNamespace(
        footage=footage, observer=observer(seen_by), estimated=estimated, blind_cameras=lambda: late
    )
    places_m = np.array([[[-0.6, 0.0, 0.9]], [[0.6, 0.0, 0.9]]])
    blind = blind_to_people(prepared, places_m)
    assert blind.tolist() == [[[False, False, True, True]], [[False, False, False, True]]]
    masks[3] = []  # what an empty view shows counts
    late[:] = False
    assert not blind_to_people(prepared, places_m)[:, 0, 3].any()
    footage.people = None
    assert not blind_to_people(prepared, places_m).any()
