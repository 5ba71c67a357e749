import cv2
import numpy as np
import pytest
from scipy import ndimage

from calib.components import label_components


@pytest.mark.parametrize("shape", [(30, 40), (9, 10, 11)])
@pytest.mark.parametrize("diagonal", [True, False])
def test_components_agree_with_scipy(shape, diagonal):
    mask = np.random.default_rng(2).random(shape) < 0.25
    components = label_components(mask, diagonal=diagonal)
    neighbours = ndimage.generate_binary_structure(mask.ndim, mask.ndim if diagonal else 1)
    labels, count = ndimage.label(mask, neighbours)
    assert len(components.sizes) == count + 1
    # Every component of ours is one of SciPy's; only the numbers may differ.
    pairs = np.unique(np.stack([components.labels[mask], labels[mask]]), axis=1)
    assert pairs.shape[1] == count
    assert (components.labels[~mask] == 0).all()
    ours, theirs = pairs
    np.testing.assert_array_equal(components.sizes[ours], np.bincount(labels[mask])[theirs])
    centres = ndimage.center_of_mass(mask, labels, theirs)
    np.testing.assert_allclose(components.centroids[ours - 1], centres, atol=1e-12)


def test_bounds_and_centroids_agree_with_opencv():
    mask = np.random.default_rng(3).random((50, 60)) < 0.1
    components = label_components(mask)
    _, labels, stats, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    np.testing.assert_array_equal(components.labels, labels)
    np.testing.assert_array_equal(components.centroids[:, ::-1], centres[1:])
    np.testing.assert_array_equal(components.bounds[:, 0, ::-1], stats[1:, :2])
    np.testing.assert_array_equal(np.diff(components.bounds, axis=1)[:, 0, ::-1], stats[1:, 2:4])


def test_an_empty_mask_has_no_component():
    for shape in ((4, 5), (2, 3, 4)):
        components = label_components(np.zeros(shape, bool))
        assert components.sizes.tolist() == [0]
        assert components.bounds.shape == (0, 2, len(shape))
        assert components.centroids.shape == (0, len(shape))
