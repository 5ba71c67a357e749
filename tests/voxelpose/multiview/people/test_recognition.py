"""Who comes back is told by the colours."""

from types import SimpleNamespace as namespace

import numpy as np
import pytest

from tests.voxelpose.multiview.matching_scenes import fitting_model, photograph, stance, views
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.people.recognition import looks_of, never_at_once, rejoined

PLACES = (-0.6, 0.0), (0.6, 0.1)


def tracks(*spans):
    """Tracks of ten frames, somebody each who stands from a frame to before another."""
    axes_m = np.full((len(spans), 10, 2), np.nan)
    for own, (first, end) in zip(axes_m, spans, strict=True):
        own[first:end] = 0.0
    return axes_m


def looks(*shares):
    """Two colours of each, by the share of the first."""
    return np.array([(share, 1 - share) for share in shares])


STAYS, LEAVES, COMES = (0, 10), (0, 3), (7, 10)


@pytest.mark.parametrize(
    ("shares", "people", "owned"),
    [
        ((0.9, 0.2, 0.25), None, [[0], [1, 2]]),  # alike
        ((0.9, 0.2, 0.6), None, [[0], [1], [2]]),  # more than half as different as two at once
        ((0.9, 0.2, 0.6), 3, [[0], [1], [2]]),
        ((0.9, 0.2, 0.6), 2, [[0], [1, 2]]),  # two are told
        (None, None, [[0], [1], [2]]),
        (None, 2, [[0], [1, 2]]),
    ],
)
def test_who_comes_back_is_who_left_if_both_look_alike(shares, people, owned):
    known = None if shares is None else looks(*shares)
    assert rejoined(tracks(STAYS, LEAVES, COMES), known, people) == owned


def test_of_two_who_left_the_more_alike_comes_back_and_nobody_is_there_twice():
    two_left = tracks(LEAVES, LEAVES, COMES)
    assert rejoined(two_left, looks(0.9, 0.2, 0.88), None) == [[0, 2], [1]]
    assert rejoined(tracks(STAYS, STAYS), looks(0.5, 0.5), 1) == [[0], [1]]


def test_somebody_alone_who_goes_and_comes_twice_is_one():
    alone = tracks((0, 2), (4, 6), (8, 10))
    (owned,) = rejoined(alone, looks(0.5, 0.52, 0.5), None)
    assert sorted(owned) == [0, 1, 2]
    assert not never_at_once(tracks(STAYS, LEAVES)).any()


def test_colours_are_those_of_the_pixels_that_are_one_persons_alone():
    """One wears red, one blue; a camera whose pictures come a frame late shows them later."""
    seen_by, model = views(4), fitting_model()
    people = [photograph(seen_by, model, stance(model, {}, place)) for place in PLACES]
    masks = [np.logical_or(*pair) for pair in zip(*people, strict=True)]
    volume = VoxelGrid.from_bounds((-1.5, -1.5, -0.05), (1.5, 1.5, 2.1), 0.05)
    names = seen_by.rig.names

    def at(steps):
        for t in steps:
            pictures = {}
            for c, name in enumerate(names):
                picture = np.full((*masks[c].shape, 3), 90, np.uint8)
                if t > 0 or c:  # the first camera is late
                    picture[people[0][c]], picture[people[1][c]] = (0, 0, 200), (200, 0, 0)
                pictures[name] = picture
            yield pictures

    def undistort_part(picture, corner, size):
        return picture

    lenses = [namespace(pinhole=camera, undistort_part=undistort_part) for camera in seen_by.rig]
    footage = namespace(source=namespace(at=at, rig=seen_by.rig), lenses=lenses, late=[1, 0, 0, 0])
    observer = HullObserver(seen_by, volume, 0.025, body_rule(4, 0))
    prepared = namespace(store=[masks, masks], observer=observer, footage=footage)
    axes_m = np.array([[PLACES[0]] * 2, [PLACES[1]] * 2])
    red, blue = looks_of(prepared, axes_m)
    assert np.isclose([red.sum(), blue.sum()], 1).all()
    assert (red > 0.9).sum() == 1 and (blue > 0.9).sum() == 1
    assert red.argmax() != blue.argmax()
