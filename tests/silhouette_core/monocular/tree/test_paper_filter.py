"""Paper A's filter has what the paper says; position and distance follow the person."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import identity

from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.image.distance import pixel_weights
from silhouette_core.monocular.making.build import build_library
from silhouette_core.monocular.tree.paper_filter import (
    INITIAL_SIGMA_RAD,
    PaperFilter,
    initial_prior,
)
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at
from tests.silhouette_core.monocular.making.small_library import SETTINGS, small_bases, swaying

DISTANCE_M = 264 * 1.75 / 158  # at which the camera's focal length is the window's
INTERVAL_S = 1 / 30


@pytest.fixture(scope="module")
def library():
    settings = replace(SETTINGS, poses=240)
    return build_library(small_bases(settings), swaying().model, settings)


@pytest.fixture(scope="module")
def camera():
    """Sees a window's silhouette of the library as it is."""
    return camera_at((0, -DISTANCE_M, 1.0), size=(320, 240))


def seen(library, sample, shift=(0, 0)):
    return np.roll(library.render(np.array([sample])).windows[0] > 0, shift, (1, 0))


class Watched(PaperFilter):
    """Keeps the priors."""

    def _update(self, prior, window):
        self.priors = [*getattr(self, "priors", []), prior]
        return super()._update(prior, window)


def follow(library, camera, matrix, masks, numbers=None, **options):
    """The filter after some frames, and its posteriors."""
    first = initial_prior(library)
    tracker = Watched(library, matrix, camera, DISTANCE_M, first, "nwxor", 0.05, **options)
    numbers = range(len(masks)) if numbers is None else numbers
    frames = [tracker.step(k * INTERVAL_S, mask) for k, mask in zip(numbers, masks, strict=True)]
    return tracker, frames


def test_distance_is_the_density_of_weighted_disagreement(library, camera):
    """Eq. (7) with (9), in one place, relative to nothing."""
    mask, given = seen(library, 7), []

    class Listening(CpuBackend):
        def span_distances(self, target, spans, which, parallel=True):
            given.append((target, spans, which))
            return super().span_distances(target, spans, which, parallel)

    stay = identity(len(library), format="csr")
    _, (frame,) = follow(library, camera, stay, [mask], in_place=True, backend=Listening())
    assert len(given) == 3
    for number, (target, _, _) in enumerate(given):
        reduced, reached = frame.window.mask, frame.window.seen
        for _ in range(2 - number):
            reduced, reached = reduce_silhouette(reduced), reduce_silhouette(reached)
        weights = pixel_weights(reduced, "nwxor", library.bounds_px) * reached
        np.testing.assert_array_equal(target.masks[0], reduced)
        np.testing.assert_array_equal(target.weights[0], weights)
        assert target.scale == 1 / reduced.size and not target.shifts_px.any()


def test_initial_prior_is_a_gaussian_about_upright_and_facing(library):
    prior = initial_prior(library)
    assert prior.sum() == pytest.approx(1)
    base = library.sample_base == library.sample_base[prior.argmax()]
    by_view = [prior[base & (library.sample_view == k)][0] for k in range(len(library.views))]
    assert np.argmax(by_view) == np.argmax(np.cos(library.views[:, 0]))
    assert pytest.approx(np.radians(45)) == INITIAL_SIGMA_RAD


def test_posterior_is_likelihood_times_prior(library, camera):
    """Eq. (1), (10), (12), (13), over the leaves that survive."""
    stay = identity(len(library), format="csr")
    mask = seen(library, 7)
    _, (frame,) = follow(library, camera, stay, [mask], in_place=True)
    weights = pixel_weights(frame.window.mask, "nwxor", library.bounds_px).astype(float)
    sigma = 0.05 * weights[frame.window.mask].sum()
    leaves = library.levels[-1]
    leaf_of = np.empty(len(library), int)
    leaf_of[library.leaf_samples] = np.repeat(np.arange(len(leaves)), np.diff(library.leaf_offsets))
    leaf = leaves.representative[leaf_of[frame.samples]]
    shown = library.render(leaf).windows > 0
    apart = np.array([weights[frame.window.mask ^ one].sum() for one in shown])
    expected = np.exp(-0.5 * (apart / sigma) ** 2) * initial_prior(library)[frame.samples]
    np.testing.assert_allclose(frame.probability[:, 0], expected / expected.sum(), rtol=1e-6)
    assert (np.diff(frame.probability.max(axis=1)) <= 0).all()


def test_prior_is_the_motion_model_alone(library, camera):
    """No floor: what the motion model does not reach has no probability."""
    matrix = transitions(library, True, neighbours=8)
    masks = [seen(library, sample) for sample in (5, 5, 40)]
    tracker, frames = follow(library, camera, matrix, masks, (0, 1, 4), in_place=True)
    np.testing.assert_array_equal(tracker.priors[0][:, 0], initial_prior(library))
    assert (tracker.priors[1] == 0).any()
    assert [prior.sum() for prior in tracker.priors] == pytest.approx([1, 1, 1])
    moved = np.zeros(len(library))
    moved[frames[1].samples] = frames[1].probability[:, 0]
    for _ in range(3):  # frame intervals
        moved = matrix.T @ moved
    np.testing.assert_allclose(tracker.priors[2][:, 0], moved, rtol=1e-5, atol=1e-12)


def test_lost_track_is_not_started_again(library, camera):
    stay = identity(len(library), format="csr")
    box = np.zeros((240, 320), bool)
    box[60:100, 30:290] = True
    masks = [seen(library, 5), box, box, seen(library, 100)]
    tracker, frames = follow(library, camera, stay, masks, in_place=True)
    possible = tracker.priors[1][:, 0] > 0
    assert all(not (prior[~possible] > 0).any() for prior in tracker.priors[1:])
    assert possible[[frame.samples[0] for frame in frames[1:]]].all()
    assert not possible[100]


def test_somebody_who_walks_is_followed(library, camera):
    """The root moves as the silhouette does, and keeps its place where that stands still."""
    matrix = transitions(library, True)
    masks = [seen(library, 5, (3 * k, 0)) for k in range(8)]
    tracker, frames = follow(library, camera, matrix, masks)
    roots = np.concatenate([tracker.poses(frame, [0]).root_m for frame in frames])
    step_m = 3 * DISTANCE_M / 264
    assert np.diff(roots[:, 0]).mean() == pytest.approx(step_m, rel=0.2)
    assert np.ptp(roots[:, 2]) < 0.03
    assert frames[-1].probability.shape[1] == 9


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_a_wrong_distance_is_mended(library, factor):
    """By the silhouette's size."""
    there = camera_at((0, -DISTANCE_M * factor, 1.0), size=(320, 240))
    near = replace(there, matrix=there.matrix @ np.diag([factor, factor, 1]))
    matrix = transitions(library, True)
    _, frames = follow(library, near, matrix, [seen(library, 5)] * 12)
    assert abs(frames[-1].window.distance_m / DISTANCE_M / factor - 1) < 0.4 * abs(factor - 1)
