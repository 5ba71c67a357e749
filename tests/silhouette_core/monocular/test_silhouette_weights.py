"""Pixel weights of a window's silhouette, relative to it."""

import numpy as np
import pytest

from silhouette_core.image.distance import pixel_weights
from silhouette_core.monocular.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.rendering import STATURE_PX, silhouette_levels
from silhouette_core.monocular.window import look_at
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed


@pytest.fixture(scope="module")
def window():
    """The person near the border: some of the window is not seen."""
    camera = camera_at((0.6, -3.8, 1.2), (0.75, 0, 0.95), (400, 300))
    return look_at(camera, films(performed("wave"), camera, [20])[0], 4.0, STATURE_PX / STATURE_M)


def test_weights_are_the_balanced_ones_over_the_silhouettes_own(window):
    picture, weights = relative_weights(window, 1)
    balanced = pixel_weights(window.mask, "balanced")
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
