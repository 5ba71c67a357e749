"""Whose pixel: one person's silhouettes among several people's."""

from types import SimpleNamespace

import numpy as np

from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.people.own_silhouettes import (
    hull_pieces,
    own_and_unknown,
    seen_pieces,
    silhouettes_of,
)
from voxelpose.multiview.silhouettes.mask_store import MaskStore

VOLUME = VoxelGrid.from_bounds((-1.5, -1.5, -0.05), (1.5, 1.5, 2.1), 0.05)


def row(*columns):
    mask = np.zeros((1, 12), bool)
    mask[0, list(columns)] = True
    return mask


def test_pixels_are_the_nearest_persons_and_unknown_where_another_is():
    foreground = row(*range(1, 11))
    pieces = [[row(2, 3, 4, 5)], [row(5, 6, 7, 8)]]
    (own,), (unknown,) = own_and_unknown([foreground], pieces, 0)
    assert np.flatnonzero(own).tolist() == [1, 2, 3, 4]  # 5 is the other's as well
    assert np.flatnonzero(unknown).tolist() == [5, 6, 7, 8, 9, 10]
    (own,), (unknown,) = own_and_unknown([foreground], pieces, 1)
    assert np.flatnonzero(own).tolist() == [6, 7, 8, 9, 10]
    assert np.flatnonzero(unknown).tolist() == [1, 2, 3, 4, 5]


def test_where_pieces_of_hull_overlap_a_pixel_may_be_eithers():
    pieces = [[row(2, 3, 4, 5)], [row(5, 6, 7, 8)]]
    for person, columns in ((0, [1, 2, 3, 4, 5]), (1, [5, 6, 7, 8, 9, 10])):
        (own,), (unknown,) = own_and_unknown([row(*range(1, 11))], pieces, person, bodies=False)
        assert np.flatnonzero(own).tolist() == columns and not (own & unknown).any()


def test_where_another_is_drawn_before_the_background_nothing_is_known():
    """It is that one's mistake, and not this one's."""
    (own,), (unknown,) = own_and_unknown([row(1, 2)], [[row(1, 2)], [row(8, 9)]], 0)
    assert np.flatnonzero(own).tolist() == [1, 2]
    assert np.flatnonzero(unknown).tolist() == [8, 9]


def test_whom_the_network_sees_has_the_pixels_of_the_mask_and_others_have_not():
    pieces = [[row(1, 2, 3, 4, 5)], None, [row(4, 5, 6, 7, 8)]]
    first, away, second = seen_pieces(pieces, [[row(5, 6, 7), row(1, 2, 3)]])
    assert away is None
    assert np.flatnonzero(first[0]).tolist() == [1, 2, 3]
    assert np.flatnonzero(second[0]).tolist() == [5, 6, 7]
    first, _, second = seen_pieces(pieces, [[row(4, 5, 6, 7)]])  # the other is not seen
    assert np.flatnonzero(first[0]).tolist() == [1, 2, 3]
    assert np.flatnonzero(second[0]).tolist() == [4, 5, 6, 7]
    first, _, second = seen_pieces(pieces, [[row(10, 11)]])  # somebody else
    assert [np.flatnonzero(one[0])[0] for one in (first, second)] == [1, 4]


def test_what_others_may_hide_is_a_share_of_the_persons_own_piece():
    views = SimpleNamespace(rig=[SimpleNamespace(size=(12, 1))])
    store = MaskStore([(12, 1)], 2)
    for t in range(2):
        store.put(t, [row(*range(1, 11))])
    pieces = [[[row(2, 3, 4, 5)], [row(5, 6, 7, 8)]], [None, [row(5, 6)]]]
    places_m = np.zeros((2, 2, 3))
    with silhouettes_of(store, iter(pieces), places_m, views) as ((own, first), (_, second)):
        assert first.hidden.tolist() == [0.25, 1.0]
        assert second.hidden.tolist() == [0.25, 0.0]
        assert np.flatnonzero(own[0][0]).tolist() == [1, 2, 3, 4]
        assert np.flatnonzero(second.unknown[0][0]).tolist() == [1, 2, 3, 4, 5]
    store.close()


def test_who_is_alone_has_the_whole_foreground():
    (own,), (unknown,) = own_and_unknown([row(1, 7)], [[row(1)], None], 0)
    assert np.flatnonzero(own).tolist() == [1, 7] and not unknown.any()


def test_the_hull_about_each_person_is_seen_where_the_person_is():
    seen_by = views(4)
    bodies, places = (fitting_model(), other_body()), ((-0.5, 0.0), (0.5, 0.1))
    people = [
        photograph(seen_by, body, stance(body, {}, place))
        for body, place in zip(bodies, places, strict=True)
    ]
    masks = [a | b for a, b in zip(*people, strict=True)]
    axes = np.array([*places, (np.nan, np.nan)])
    observer = HullObserver(seen_by, VOLUME, 0.025, body_rule(4, 0))
    *pieces, absent = hull_pieces(masks, axes, observer)
    assert absent is None
    for k, (piece, own) in enumerate(zip(pieces, people, strict=True)):
        assert piece is not None
        for c, mask in enumerate(own):
            assert (piece[c] & mask).sum() > 0.97 * mask.sum()
        mine, unknown = own_and_unknown(masks, pieces, k, bodies=True)
        for c, mask in enumerate(own):
            known = ~unknown[c]
            wrong = (mine[c] ^ mask) & known
            assert wrong.sum() < 0.02 * mask.sum()


def test_what_is_farther_than_limbs_reach_is_nobodys():
    """Reflections and shadows leave hull, too, and it would hide much of others."""
    model, seen_by = fitting_model(), views(4)
    near, far = (
        photograph(seen_by, model, stance(model, {}, place)) for place in ((-0.9, 0), (0.9, 0.4))
    )
    masks = [a | b for a, b in zip(near, far, strict=True)]
    observer = HullObserver(seen_by, VOLUME, 0.025, body_rule(4, 0))
    (piece,) = hull_pieces(masks, np.array([(-0.9, 0.0)]), observer)
    assert piece is not None
    triples = [*zip(piece, near, far, strict=True)]
    assert all((own & mask).sum() > 0.97 * mask.sum() for own, mask, _ in triples)
    taken = sum((own & other & ~mask).sum() for own, mask, other in triples)
    assert taken < 0.3 * sum(mask.sum() for mask in far)
