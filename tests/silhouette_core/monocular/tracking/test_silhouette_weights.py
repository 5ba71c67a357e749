"""Balanced pixel weights of a window's silhouette, relative to it."""

import numpy as np
import pytest

from silhouette_core.image.distance import distances_to, relative_depths
from silhouette_core.monocular.tracking.silhouette_weights import balanced_weights, relative_weights
from silhouette_core.monocular.tree.rendering import STATURE_PX, silhouette_levels
from silhouette_core.monocular.window import look_at
from tests.silhouette_core.image.drawn_figures import figure
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed


@pytest.fixture(scope="module")
def window():
    """The person near the border: some of the window is not seen."""
    camera = camera_at((0.6, -3.8, 1.2), (0.75, 0, 0.95), (400, 300))
    return look_at(camera, films(performed("wave"), camera, [20])[0], 4.0, STATURE_PX / STATURE_M)


@pytest.mark.parametrize("height", [30, 60, 120])
def test_weights_outside_grow_over_a_twentieth_of_the_height(height):
    mask = figure(np.random.default_rng(height), (height, height * 4 // 3))
    expected = relative_depths(mask) + np.minimum(distances_to(mask) / (0.05 * height), 1)
    np.testing.assert_allclose(balanced_weights(mask), expected, rtol=2e-5)


def test_silhouettes_without_a_contour_weigh_one():
    for mask in (np.zeros((6, 8), bool), np.ones((6, 8), bool)):
        assert (balanced_weights(mask) == 1).all()


def test_weights_are_the_balanced_ones_over_the_silhouettes_own(window):
    picture, weights = relative_weights(window, 1)
    balanced = balanced_weights(window.mask)
    assert (picture == window.mask).all()
    assert weights[picture].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(
        weights[window.seen] / weights[picture].max(),
        balanced[window.seen] / balanced[picture].max(),
        rtol=1e-5,
    )
    assert not window.seen.all() and (weights[~window.seen] == 0).all()


def test_resolutions_are_reduced_as_the_librarys(window):
    for reduction, mask in zip((4, 2, 1), silhouette_levels(window.mask), strict=True):
        assert (relative_weights(window, reduction)[0] == mask).all()
