"""Samples that explain a silhouette, each frame by itself."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.monocular.tracking.silhouette_weights import relative_weights
from silhouette_core.monocular.tree import sample_proposer
from silhouette_core.monocular.tree.rendering import masks_of
from silhouette_core.monocular.tree.sample_proposer import find_samples
from silhouette_core.monocular.tuning import DISTANCES, FILTER
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at, films, performed, window_pixels

CAMERA = camera_at((0, -4.0, 1.3))


@pytest.fixture(scope="module")
def walk():
    motion, rows = performed("walk"), range(0, 45, 9)
    return motion.root_m[list(rows)], films(motion, CAMERA, rows)


@pytest.fixture(scope="module")
def found(library, walk):
    """Of each frame."""
    return [find_samples(library, CAMERA, mask, CpuBackend()) for mask in walk[1]]


def likelihoods(library, found, leaves):
    """Likelihoods (K,) of some leaves, up to a factor, every pixel looked at."""
    level, likelihood = library.levels[-1], np.zeros(len(leaves))
    images = masks_of(level.spans, leaves).reshape(len(leaves), -1).astype(np.float32)
    for window in found.alignments.windows:
        picture, weights = relative_weights(window, 1)
        signed = np.where(picture, -weights, weights).astype(np.float32)
        for shift in itertools.product((-1, 0, 1), repeat=2):
            distance = 1 + images @ np.roll(signed, shift, (0, 1)).ravel()
            likelihood += np.exp(-0.5 * (distance / FILTER.sigma) ** 2)
    return likelihood


def test_leaves_are_in_the_order_of_a_search_pixel_by_pixel(library, found):
    leaf = np.empty(len(library), int)
    numbers = np.arange(len(library.levels[-1]))
    leaf[library.leaf_samples] = np.repeat(numbers, np.diff(library.leaf_offsets))
    chosen = np.linspace(0, len(found[0].samples) - 1, 8).astype(int)
    among = likelihoods(library, found[0], leaf[found[0].samples[chosen]])
    assert among[0] == among.max() > 10 * among[-1]
    others = likelihoods(library, found[0], np.random.default_rng(0).choice(numbers, 20))
    assert (others <= among[0]).all()


def test_somebody_who_comes_nearer_is_seen_to(walk, found):
    truth = np.linalg.norm(walk[0] - CAMERA.center_m, axis=1)
    assert np.ptp(truth) > 0.8
    np.testing.assert_allclose([one.distance_m for one in found], truth, rtol=0.10)


def test_a_distance_that_is_told_is_kept(library, walk):
    found = find_samples(library, CAMERA, walk[1][0], CpuBackend(), 3.9)
    assert found.distance_m == pytest.approx(3.9) and len(found.alignments.windows) == 1


def test_poses_stand_where_their_silhouettes_are_moved_to(library, found):
    one, rows = found[0], [0, 1, 2, 7]
    poses = one.poses(rows)
    number, shift = np.divmod(one.probability.argmax(axis=1), 9)
    for row, root_m in zip(rows, poses.root_m, strict=True):
        pelvis_px = library.pelvis_px[one.samples[row]] + (shift[row] % 3 - 1, shift[row] // 3 - 1)
        window = one.alignments.windows[number[row]]
        np.testing.assert_allclose(window_pixels(window, root_m)[0], pelvis_px, atol=1e-3)
    assert (shift != 4).any() and len(set(number.tolist())) > 1
    np.testing.assert_allclose(np.linalg.det(poses.root_rotation), 1.0, atol=1e-6)
    assert poses.angles_rad.shape == (4, library.model.dof_count)


def test_views_of_another_pitch_are_unlikely(library, walk, monkeypatch):
    """By the camera's own."""
    priors, posterior = [], sample_proposer.tree_posterior
    monkeypatch.setattr(
        sample_proposer,
        "tree_posterior",
        lambda *given: priors.append(given[1]) or posterior(*given),
    )
    window = find_samples(library, CAMERA, walk[1][0], CpuBackend(), 4.0).alignments.windows[0]
    away_deg = np.where(np.arange(len(library.views)) % 2, 0.0, 16.0)
    pitch_rad = window.pitch_rad + np.radians(away_deg)
    other = replace(library, views=np.column_stack([library.views[:, 0], pitch_rad]))
    find_samples(other, CAMERA, walk[1][0], CpuBackend(), 4.0)
    prior = priors[1][:, 0]
    expected = np.exp(-0.5 * (16.0 / DISTANCES.pitch_sigma_deg) ** 2)
    assert prior[library.sample_view % 2 == 0] == pytest.approx(expected)
    assert prior[library.sample_view % 2 == 1] == pytest.approx(1)
