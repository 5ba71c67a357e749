"""Distances from silhouettes are the nearest ones; thinning is Guo and Hall's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.morphology import thin as thin_of_scikit_image

from silhouette_core.image.distance import distances_to, relative_depths, thin_silhouette
from silhouette_core.image.spans import Spans
from tests.silhouette_core.image.drawn_figures import figure, to_set


@given(st.integers(0, 10**6), st.sampled_from([30, 60, 120]))
@settings(max_examples=30, deadline=None)
def test_distances_and_depths_are_those_of_every_pixel(seed, height):
    """Also of silhouettes that the window cuts off."""
    rng = np.random.default_rng(seed)
    mask = figure(rng, (height, height * 4 // 3))
    mask[rng.integers(0, height) :, : rng.integers(0, height)] |= rng.random() < 0.3
    distances, depths = distances_to(mask), relative_depths(mask)
    assert distances.dtype == depths.dtype == np.float32
    np.testing.assert_allclose(distances, to_set(mask, mask.shape), rtol=1e-6)
    inside, middle = (to_set(points, mask.shape) for points in (~mask, thin_silhouette(mask)))
    expected = np.where(mask, inside / np.where(mask, inside + middle, 1), 0)
    np.testing.assert_allclose(depths, expected, rtol=2e-5, atol=1e-6)


def test_bounds_hold_all_silhouettes():
    masks = np.zeros((3, 20, 30), bool)
    masks[0, 3:7, 10:25] = masks[1, 5:16, 4:6] = True
    assert Spans.from_masks(masks).bounds == (4, 3, 25, 16)
    assert Spans.from_masks(masks[2:]).bounds == (0, 0, 0, 0)


def test_thinning_is_that_of_scikit_image():
    rng = np.random.default_rng(4)
    masks = [figure(rng, (120, 160)) for _ in range(20)]
    masks += [rng.random((40, 50)) < share for share in (0.3, 0.6, 0.9)]
    masks += [np.ones((9, 12), bool), np.zeros((5, 5), bool), np.pad(np.ones((2, 2), bool), 2)]
    for mask in masks:
        assert (thin_silhouette(mask) == thin_of_scikit_image(mask)).all()


def test_images_that_are_no_masks_are_refused():
    with pytest.raises(TypeError, match=r"mask must be \(h, w\) bool"):
        thin_silhouette(np.zeros((3, 4)))  # type: ignore[arg-type]
