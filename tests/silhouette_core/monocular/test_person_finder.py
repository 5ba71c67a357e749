"""Several people before one camera: each while apart, nobody while merged."""

import numpy as np
import pytest

from benchmarks.silhouette_source import SilhouetteSource
from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.monocular.person_finder import OneOfPeople, PersonFinder, people_apart
from silhouette_core.progress import SilentReporter
from tests.sources import ring

CAMERA = ring(1, (320, 240)).cameras[0]
RED, BLUE = (30, 30, 200), (200, 60, 30)
CAP = (40, 40, 40)


def filmed(*columns, colours=(RED, BLUE), seen=False):
    """A picture, its foreground, and whom the pose network sees, if it is asked: people of 30 by
    100 px, whose left edges are at columns.
    """
    people = []
    picture, mask = np.full((240, 320, 3), 120, np.uint8), np.zeros((240, 320), bool)
    for left, colour in zip(columns, colours, strict=False):
        if left is not None:
            box = slice(80, 180), slice(max(left, 0), max(left + 30, 0))
            picture[box], mask[box] = colour, True
            picture[box][:15] = CAP
        people.append(np.zeros_like(mask))
        people[-1][box] = True
    apart = [one & ~other for one, other in zip(people, people[::-1], strict=True)]
    return picture, mask, apart if seen else ()


def followed(frames, count=2, coloured=True):
    """By person, the left edge in every frame; None: not found. And how many frames are merged."""
    people = people_apart(iter(frames), CAMERA, count, coloured)
    finders = [OneOfPeople(CAMERA, coloured, people, k) for k in range(len(people))]
    found = [[finder.find(*frame) for frame in frames] for finder in finders]
    lefts = [
        [one and int(np.flatnonzero(one.mask.any(axis=0))[0]) for one in person] for person in found
    ]
    return lefts, [finder.merged for finder in finders]


def walk(start, stop, count):
    return np.linspace(start, stop, count).round().astype(int).tolist()


def test_people_who_pass_each_other_keep_their_numbers():
    one, other = walk(40, 240, 41), walk(240, 40, 41)
    lefts, merged = followed([filmed(*columns) for columns in zip(one, other, strict=True)])
    near = [abs(a - b) <= 30 for a, b in zip(one, other, strict=True)]
    assert lefts[0] == [None if hidden else a for a, hidden in zip(one, near, strict=True)]
    behind = one.index(140)  # the second hides the first wholly, and is seen alone
    near[behind] = False
    assert lefts[1] == [None if hidden else b for b, hidden in zip(other, near, strict=True)]
    assert merged == [sum(near)] * 2 and 3 < sum(near) < 12


def test_people_who_pass_each_other_are_found_in_one_silhouette_where_the_network_sees_both():
    one, other = walk(40, 240, 41), walk(240, 40, 41)
    frames = [filmed(*columns, seen=True) for columns in zip(one, other, strict=True)]
    lefts, merged = followed(frames)
    touching = [15 < abs(a - b) <= 30 for a, b in zip(one, other, strict=True)]
    assert sum(touching) >= 4
    for left, true in zip(lefts, (one, other), strict=True):
        found = [a is not None for a, near in zip(left, touching, strict=True) if near]
        assert np.mean(found) > 0.7
        off = [abs(a - b) for a, b in zip(left, true, strict=True) if a is not None]
        assert max(off) <= 15  # what both cover is nobody's here
    assert merged[0] == merged[1] >= sum(touching)  # told apart, and less sure


def test_whoever_touches_the_only_person_is_left_out_where_the_network_sees_both():
    finder = PersonFinder(CAMERA, coloured=False)
    for other in walk(200, 129, 30) + walk(129, 200, 30):
        found = finder.find(*filmed(100, other, seen=True))
        assert np.flatnonzero(found.mask.any(axis=0))[[0, -1]].tolist() == [100, 129]


def test_those_who_turn_back_are_told_by_their_colours():
    one, other = walk(60, 128, 20) + walk(128, 60, 20), walk(220, 150, 20) + walk(150, 220, 20)
    frames = [filmed(*columns) for columns in zip(one, other, strict=True)]
    (first, second), merged = followed(frames)
    assert merged[0] > 0 and first[-1] == 60 and second[-1] == 220


def test_who_leaves_the_picture_takes_nobody_along():
    one, other = walk(150, 170, 30), walk(60, -40, 30)
    lefts, merged = followed([filmed(*columns) for columns in zip(one, other, strict=True)])
    (stays, leaves) = sorted(lefts, key=lambda found: found.count(None))
    assert stays == one and merged == [0, 0]
    assert leaves[0] == 60 and leaves[-3:] == [None] * 3


def test_of_people_who_are_merged_at_first_nobody_is_invented():
    one, other = [150] * 30, walk(160, 260, 30)
    lefts, merged = followed([filmed(*columns) for columns in zip(one, other, strict=True)])
    near = sum(left <= 180 for left in other)
    for left, true in zip(sorted(lefts, key=lambda left: left[-1]), (one, other), strict=True):
        assert left == [None] * near + true[near:]
    assert merged == [near, near]


def test_without_colours_places_decide():
    one, other = walk(40, 240, 41), walk(240, 40, 41)
    frames = [filmed(*columns) for columns in zip(one, other, strict=True)]
    (first, second), _ = followed(frames, coloured=False)
    assert (first[-1], second[-1]) == (240, 40)


def test_a_small_piece_belongs_to_the_nearest_person():
    frames = [filmed(100, 200) for _ in range(6)]
    for _, mask, _ in frames:
        mask[120:130, 134:142] = True  # a hand behind a gap
    people = people_apart(iter(frames), CAMERA, 2, True)
    found = [OneOfPeople(CAMERA, True, people, k).find(*frames[0]) for k in range(2)]
    assert [person.mask[125, 137] for person in found] == [True, False]


def test_fewer_people_than_asked_for_are_refused():
    y, x = np.mgrid[:240, :320]
    masks = [np.hypot((x - 160 - t) / 15, (y - 130) / 60) < 1 for t in range(4)]
    settings = Settings(1.7, threads=2, options={})
    with pytest.raises(InputError, match=r"2 people were asked for, and 1 at most are.*--people 1"):
        MonocularEstimator().estimate_people(
            SilhouetteSource(CAMERA, masks, 25.0), settings, SilentReporter(), 2
        )
