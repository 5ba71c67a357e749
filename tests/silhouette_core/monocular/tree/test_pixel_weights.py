"""Weights of nwXOR follow eq. (9), at every resolution."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silhouette_core.image.distance import distances_to, relative_depths
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.tree.pose_library import LibrarySettings, nwxor_weights
from silhouette_core.scoring.backend import Target
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.image.drawn_figures import figure

WINDOW = 0, 0, 320, 240


@given(st.integers(0, 10**6), st.sampled_from([30, 60, 120]))
@settings(max_examples=30, deadline=None)
def test_weights_follow_the_equation(seed, height):
    """In rectangles that hold every pose."""
    rng = np.random.default_rng(seed)
    mask = figure(rng, (height, height * 4 // 3))
    columns, rows = (np.sort(rng.choice(most, 2, replace=False)).tolist() for most in (321, 241))
    outside = distances_to(mask).astype(float)
    row, column = np.mgrid[: mask.shape[0], : mask.shape[1]] * (240 / height)
    pixel = 240 / height
    for left, top, right, bottom in (WINDOW, (columns[0], rows[0], columns[1], rows[1])):
        held = (column + pixel > left) & (column < right) & (row + pixel > top) & (row < bottom)
        expected = relative_depths(mask) + outside / (outside[held].max(initial=0) or outside.max())
        weights = nwxor_weights(mask, (left, top, right, bottom))
        assert weights.shape == mask.shape and weights.dtype == np.float32
        np.testing.assert_allclose(weights, expected, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("weighting", ["xor", "nwxor"])
def test_resolutions_agree(weighting):
    """A pixel at a contour lies one whole pixel inside, of whatever size."""
    rng, by = np.random.default_rng(1), LibrarySettings(weighting=weighting)

    def distances(mask, *others):
        spans = Spans.from_masks(others)
        target = Target((mask,), (by.weights(mask, WINDOW),), scale=1 / mask.size)
        return CpuBackend().span_distances(target, spans, np.arange(len(spans)))[:, 0]

    large = [figure(rng, (240, 320)) for _ in range(8)]
    small = [mask.reshape(60, 4, 80, 4).mean((1, 3)) >= 0.5 for mask in large]
    rtol = 0.05 if weighting == "xor" else 0.3
    np.testing.assert_allclose(distances(*small), distances(*large), rtol=rtol)


def test_silhouettes_without_a_contour_weigh_one():
    for mask in (np.zeros((6, 8), bool), np.ones((6, 8), bool)):
        assert (nwxor_weights(mask, WINDOW) == 1).all()
