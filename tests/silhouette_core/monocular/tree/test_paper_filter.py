"""Paper A's filter has what the paper says; position and distance follow the person."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import identity

from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.pose_library import nwxor_weights
from silhouette_core.monocular.tree.rendering import masks_of, silhouette_levels
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.tuning import DISTANCES, FILTER
from silhouette_core.motion.dynamics import ROOT_STEP_M
from silhouette_core.motion.keyposes.notation import STANDING, Movement
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import camera_at
from tests.silhouette_core.monocular.tree.small_library import small_library
from tests.silhouette_core.scoring.backward_backend import BackwardBackend

DISTANCE_M = 264 * 1.75 / 158  # at which the camera's focal length is the window's
INTERVAL_S = 1 / 30


@pytest.fixture(scope="module")
def library():
    return small_library()


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


def follow(library, camera, matrix, masks, numbers=None, sigma=0.05, backend=None, **options):
    """The filter after some frames, and its posteriors."""
    first = initial_prior(library)
    backend = backend or CpuBackend()
    tracker = Watched(library, matrix, camera, DISTANCE_M, first, backend, sigma, **options)
    numbers = range(len(masks)) if numbers is None else numbers
    frames = [tracker.step(k * INTERVAL_S, mask) for k, mask in zip(numbers, masks, strict=True)]
    return tracker, frames


def test_initial_prior_is_a_gaussian_about_upright_and_facing(library):
    prior = initial_prior(library)
    assert prior.sum() == pytest.approx(1)
    standing = Movement(np.array([0.0, 1.0]), np.stack([STANDING, STANDING]), (0.0, 0.0))
    upright = perform(standing, library.model).angles_rad[0]
    turn, angles = library.pose(np.arange(len(library)))
    facing = 2 * np.arccos(np.clip(np.abs(turn[:, 0]), 0, 1))
    apart = np.square(angles - upright).sum(axis=1) + facing**2
    assert np.ptp(facing) > 3 and np.ptp(apart - facing**2) > 0.1  # both tell
    sigma = np.radians(45)
    expected = -0.5 * (apart - apart.min()) / sigma**2
    np.testing.assert_allclose(np.log(prior / prior.max()), expected, atol=1e-6)


def literal_posterior(library, window, prior, sigma):
    """Section 6 pixel by pixel: the posterior (N, C) of every sample in every position, by the
    prior (N, C), and the numbers of nodes that survive. All leaves of equal silhouettes are alike.
    """
    steps = (-4, 0, 4) if prior.shape[1] == 9 else (0,)
    shifts = [(right, down) for down in steps for right in steps]
    home = np.empty(len(library), int)
    leaves = np.arange(len(library.levels[-1]))
    home[library.leaf_samples] = np.repeat(leaves, np.diff(library.leaf_offsets))
    homes = [home]
    for level in library.levels[:0:-1]:
        homes.insert(0, level.parent[homes[0]])
    masks, reached = silhouette_levels(window.mask), silhouette_levels(window.seen)
    survivors, numbers = np.ones(1, bool), []
    for depth, level in enumerate(library.levels):
        weights = nwxor_weights(masks[depth], library.bounds_px) * reached[depth].astype(float)
        shown = masks_of(level.spans, np.arange(len(level)), level.size_px)
        # The weight of P, and over Q that of what P lacks less that of what it has: instead of
        # every Q the weights are moved, the other way.
        signed = np.where(masks[depth], -weights, weights)
        moved = [
            np.roll(signed, -np.array([down, right]) // 2 ** (2 - depth), (0, 1)).ravel()
            for right, down in shifts
        ]
        distance = weights[masks[depth]].sum() + shown.reshape(len(level), -1) @ np.transpose(moved)
        likelihood = np.exp(-0.5 * (distance / masks[depth].size / sigma) ** 2)  # (7), (9)-(11)
        posterior = np.zeros(len(level))
        np.add.at(posterior, homes[depth], (likelihood[homes[depth]] * prior).sum(axis=1))
        posterior *= survivors[level.parent if depth else np.zeros(len(level), int)]
        survivors = posterior >= FILTER.survivors * posterior.max()
        numbers.append((int(survivors.sum()), len(level)))
    result = likelihood[home] * prior * survivors[home, None]  # (12), (13)
    return result / result.sum(), numbers  # (1)


@pytest.mark.parametrize("in_place", [False, True])
@pytest.mark.parametrize("sigma", [0.1, 0.6])
def test_posterior_is_the_literal_one(library, camera, in_place, sigma):
    """Over the leaves that survive; sigma is that of the first frame."""
    stay = identity(len(library), format="csr")
    masks = [seen(library, 7), seen(library, 8), seen(library, 150)]
    tracker, frames = follow(library, camera, stay, masks, sigma=sigma, in_place=in_place)
    first = frames[0].alignments.windows[0].mask
    weight = nwxor_weights(first, library.bounds_px).astype(float)[first].sum()
    pruned = 0
    for frame, prior in zip(frames, tracker.priors, strict=True):
        given = frame.alignments.windows[0], prior, sigma * weight / first.size
        expected, numbers = literal_posterior(library, *given)
        result = np.zeros_like(expected)
        result[frame.samples] = frame.probability
        np.testing.assert_allclose(result, expected, rtol=1e-4, atol=1e-9)
        assert (np.diff(frame.probability.max(axis=1)) <= 0).all()
        pruned += sum(count < most for count, most in numbers)
    assert pruned > 3 or sigma > 0.2


def test_posterior_does_not_depend_on_the_order_of_sums(library, camera):
    stay = identity(len(library), format="csr")
    masks = [seen(library, 7), seen(library, 150)]
    (_, one), (_, other) = (
        follow(library, camera, stay, masks, backend=own()) for own in (CpuBackend, BackwardBackend)
    )
    for mine, theirs in zip(one, other, strict=True):
        np.testing.assert_array_equal(mine.samples, theirs.samples)
        np.testing.assert_array_equal(mine.probability, theirs.probability)


def test_the_position_is_a_random_walk(library, camera):
    """The joint prior of pose and position, summed over both as they were."""
    stay = identity(len(library), format="csr")
    tracker, (frame,) = follow(library, camera, stay, [seen(library, 5)], sigma=0.3)
    (window,) = frame.alignments.windows
    moved = replace(window, center_m=window.center_m + np.array([0.02, 0.0, 0.01]))
    places = tracker.places_m(moved)
    prior = tracker._predict(frame, 2 * INTERVAL_S, moved)
    assert prior.sum() == pytest.approx(1)
    for row in (0, 1):
        expected = np.zeros(len(places))
        for before, share in zip(tracker.places_m(window), frame.probability[row], strict=True):
            square = np.square(places - before).sum(axis=1) / (2 * ROOT_STEP_M**2)
            expected += share * np.exp(-0.5 * square) / np.exp(-0.5 * square).sum()
        np.testing.assert_allclose(prior[frame.samples[row]], expected, rtol=1e-6)


def test_a_pose_is_where_its_silhouette_was_moved_to(library, camera):
    stay = identity(len(library), format="csr")
    tracker, (frame,) = follow(library, camera, stay, [seen(library, 5)])
    roots = []
    for cell in range(9):
        probability = np.zeros((1, 9))
        probability[0, cell] = 1.0
        moved = replace(frame, samples=frame.samples[:1], probability=probability)
        roots.append(moved.poses([0]).root_m[0])
    places = tracker.places_m(frame.alignments.windows[0])
    np.testing.assert_allclose(roots - roots[4], places - places[4], atol=1e-9)
    assert np.ptp(np.array(roots)[:, 0]) > 0.05


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
    _, frames = follow(library, camera, matrix, masks)
    roots = np.concatenate([frame.poses([0]).root_m for frame in frames])
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
    assert abs(frames[-1].distance_m / DISTANCE_M / factor - 1) < 0.4 * abs(factor - 1)
    # Each time by a share of a step, first toward the true one.
    moved = np.diff(np.log([frame.distance_m for frame in frames]))
    steps = moved / (DISTANCES.gain * DISTANCES.step)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(steps).max() == pytest.approx(1) and steps[0] == pytest.approx(
        np.sign(factor - 1)
    )


def test_a_wrong_pose_is_neither_drawn_nearer_nor_farther(library, camera):
    """Somebody at the known distance, of whom another pose is believed."""
    stay, away = identity(len(library), format="csr"), []
    for believed, true in np.random.default_rng(0).integers(0, len(library), (12, 2)):
        first = np.zeros(len(library))
        first[believed] = 1.0
        tracker = PaperFilter(library, stay, camera, DISTANCE_M, first, CpuBackend())
        for frame in range(10):
            last = tracker.step(frame * INTERVAL_S, seen(library, true))
        away.append(np.log(last.distance_m / DISTANCE_M))
    assert np.ptp(away) > 0.1 and abs(np.mean(away)) < 0.05


def test_leaves_have_the_posterior_of_their_samples(library, camera):
    matrix = transitions(library, True)
    masks = [seen(library, 5), seen(library, 9)]
    tracker, (_, frame) = follow(library, camera, matrix, masks, sigma=0.5)
    found = tracker._update(tracker.priors[1], frame.alignments.windows[0])
    assert len(found.leaves) > 3 and found.of_leaves.sum() == pytest.approx(1)
    for leaf, expected in zip(found.leaves, found.of_leaves, strict=True):
        inside = library.leaf_samples[slice(*library.leaf_offsets[leaf : leaf + 2])]
        among = found.probability[np.isin(found.samples, inside)]
        np.testing.assert_allclose(among.sum(axis=0), expected, rtol=1e-5)
