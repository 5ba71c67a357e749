"""Silhouette distances follow the equations; thinning is Guo and Hall's."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from skimage.morphology import thin as thin_of_scikit_image

from silhouette_core.image.distance import (
    WEIGHTINGS,
    pixel_weights,
    thin_silhouette,
)
from silhouette_core.image.spans import Spans
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.target import Target


def figure(rng, shape=(60, 80)):
    """A crude person: trunk, head and four limbs of random direction."""
    image = np.zeros(shape, np.uint8)
    h = shape[0]
    middle = np.array([shape[1] / 2, h / 2]) + rng.uniform(-0.04, 0.04, 2) * h
    cv2.ellipse(
        image, middle.astype(int).tolist(), (h // 12, h // 6), rng.uniform(-20, 20), 0, 360, 1, -1
    )
    for _ in range(5):
        angle = rng.uniform(0, 2 * np.pi)
        end = middle + np.array([np.cos(angle), np.sin(angle)]) * h * rng.uniform(0.2, 0.4)
        cv2.line(image, middle.astype(int).tolist(), end.astype(int).tolist(), 1, max(1, h // 20))
    return image.astype(bool)


def distances_to(mask, masks, weighting="nwxor"):
    """Distances from a silhouette to others, as the library's tree is built with."""
    spans = Spans.from_masks(masks)
    target = Target.from_mask(mask, weighting)
    return CpuBackend().span_distances(target, spans, np.arange(len(spans)))[:, 0]


def to_set(points, shape):
    """Distance of every pixel to the nearest of `points`, the slow way."""
    grid = np.stack(np.mgrid[: shape[0], : shape[1]], -1).reshape(-1, 2)
    return cKDTree(np.argwhere(points)).query(grid)[0].reshape(shape)


def weights_as_written(mask, weighting, bounds):
    """Eq. (6), (8), (9), for silhouettes that have a contour."""
    if weighting == "xor":
        return np.ones(mask.shape)
    inside, outside = to_set(~mask, mask.shape), to_set(mask, mask.shape)
    if weighting == "wxor":
        return (inside + outside) * 240 / len(mask)
    middle = to_set(thin_silhouette(mask), mask.shape)
    if weighting == "balanced":
        outside = np.minimum(outside / (0.05 * len(mask)), 1)
    else:
        left, top, right, bottom = np.array(bounds) * len(mask) / 240
        row, column = np.mgrid[: mask.shape[0], : mask.shape[1]]
        held = (column + 1 > left) & (column < right) & (row + 1 > top) & (row < bottom)
        outside = outside / (outside[held].max(initial=0) or outside.max())
    return np.where(mask, inside / np.where(mask, inside + middle, 1), 0) + outside


@given(st.integers(0, 10**6), st.sampled_from(WEIGHTINGS), st.sampled_from([30, 60, 120]))
@settings(max_examples=60, deadline=None)
def test_weights_follow_the_equations(seed, weighting, height):
    """Also of silhouettes that the window cuts off, in rectangles that hold every pose."""
    rng = np.random.default_rng(seed)
    mask = figure(rng, (height, height * 4 // 3))
    mask[rng.integers(0, height) :, : rng.integers(0, height)] |= rng.random() < 0.3
    left, right = np.sort(rng.choice(321, 2, replace=False)).tolist()
    top, bottom = np.sort(rng.choice(241, 2, replace=False)).tolist()
    for bounds in (None, (left, top, right, bottom)):
        weights = pixel_weights(mask, weighting, bounds)
        assert weights.shape == mask.shape and weights.dtype == np.float32
        expected = weights_as_written(mask, weighting, bounds or (0, 0, 320, 240))
        np.testing.assert_allclose(weights, expected, rtol=2e-5, atol=1e-6)


def test_bounds_hold_all_silhouettes():
    masks = np.zeros((3, 20, 30), bool)
    masks[0, 3:7, 10:25] = masks[1, 5:16, 4:6] = True
    assert Spans.from_masks(masks).bounds == (4, 3, 25, 16)
    assert Spans.from_masks(masks[2:]).bounds == (0, 0, 0, 0)


def test_resolutions_agree():
    rng = np.random.default_rng(1)
    for weighting in WEIGHTINGS:
        large = [figure(rng, (240, 320)) for _ in range(8)]
        small = [mask.reshape(60, 4, 80, 4).mean((1, 3)) >= 0.5 for mask in large]
        fine, coarse = (distances_to(m[0], m[1:], weighting) for m in (large, small))
        # A pixel at a contour lies one whole pixel inside, of whatever size.
        np.testing.assert_allclose(coarse, fine, rtol=0.05 if weighting == "xor" else 0.3)


def test_thinning_is_that_of_scikit_image():
    rng = np.random.default_rng(4)
    masks = [figure(rng, (120, 160)) for _ in range(20)] + [
        rng.random((40, 50)) < share for share in (0.3, 0.6, 0.9)
    ]
    for mask in [
        *masks,
        np.ones((9, 12), bool),
        np.zeros((5, 5), bool),
        np.pad(np.ones((2, 2), bool), 2),
    ]:
        assert (thin_silhouette(mask) == thin_of_scikit_image(mask)).all()


def test_silhouettes_without_a_contour_weigh_one():
    for mask in (np.zeros((6, 8), bool), np.ones((6, 8), bool)):
        for weighting in WEIGHTINGS:
            assert (pixel_weights(mask, weighting) == 1).all()


def test_wrong_arguments_are_refused():
    with pytest.raises(TypeError, match=r"mask must be \(h, w\) bool"):
        pixel_weights(np.zeros((3, 4)), "xor")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="weighting"):
        pixel_weights(np.zeros((3, 4), bool), "and")  # type: ignore[arg-type]
