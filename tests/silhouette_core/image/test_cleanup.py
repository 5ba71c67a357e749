"""Removal of small components and holes, and cropping to regions."""

import numpy as np
import pytest

from silhouette_core.image.cleanup import clean, reduce_silhouette


@pytest.fixture
def ring() -> np.ndarray:
    mask = np.zeros((40, 50), bool)
    mask[5:30, 5:30] = True
    mask[10:20, 10:20] = False
    return mask


def test_small_components_are_removed(ring):
    with_speck = ring.copy()
    with_speck[35, 40:43] = True
    np.testing.assert_array_equal(clean(with_speck, min_area_px=4), ring)
    np.testing.assert_array_equal(clean(with_speck, min_area_px=3), with_speck)


def test_only_small_holes_are_filled(ring):
    pinhole = ring.copy()
    pinhole[7, 7] = False
    np.testing.assert_array_equal(clean(pinhole, max_hole_px=99), ring)
    assert clean(pinhole, max_hole_px=100)[12, 12]


def test_a_gap_at_the_image_border_is_not_filled():
    mask = np.ones((20, 20), bool)
    mask[0, 3] = False
    np.testing.assert_array_equal(clean(mask, max_hole_px=50), mask)


def test_nothing_outside_the_region(ring):
    region = np.zeros_like(ring)
    region[:, :15] = True
    np.testing.assert_array_equal(clean(ring, region=region), ring & region)


def test_empty_and_full():
    assert not clean(np.zeros((5, 5), bool), min_area_px=3, max_hole_px=3).any()
    assert clean(np.ones((5, 5), bool), min_area_px=3, max_hole_px=3).all()


def test_wrong_arrays_are_refused(ring):
    with pytest.raises(TypeError, match=r"mask must be \(H, W\) bool, got \(5, 5\) uint8"):
        clean(np.zeros((5, 5), np.uint8))
    with pytest.raises(ValueError, match=r"region must be \(40, 50\) bool"):
        clean(ring, region=np.ones((4, 4), bool))


def test_a_reduced_pixel_is_set_where_two_of_its_four_are():
    four = np.array(list(np.ndindex(2, 2, 2, 2)), bool)
    reduced = reduce_silhouette(four.reshape(16, 2, 2))
    np.testing.assert_array_equal(reduced.ravel(), four.sum(axis=1) >= 2)
