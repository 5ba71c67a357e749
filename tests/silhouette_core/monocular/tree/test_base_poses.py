"""Thinning against its definition."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from silhouette_core.monocular.tree.base_poses import motion_sigmas, pose_features, thin_poses
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.heading import split_heading
from tests.clips import waving


def thin_slowly(features, tolerance):
    """The paper's words, pair by pair."""
    kept, rows = [], []
    for n, pose in enumerate(features):
        if not any((np.abs(pose - other) <= tolerance).all() for other in kept):
            kept.append(pose)
            rows.append(n)
    return rows


@settings(max_examples=150, deadline=None)
@given(
    st.integers(1, 9).flatmap(
        lambda k: arrays(
            np.float64, st.tuples(st.integers(0, 40), st.just(k)), elements=st.integers(-6, 6)
        )
    )
)
def test_agrees_with_its_definition(steps):
    # Multiples of half the tolerance: many differences are the tolerance exactly, and cells' edges
    # are met.
    features = steps * 0.5
    assert thin_poses(features, 1.0).tolist() == thin_slowly(features, 1.0)


def test_agrees_on_walks_through_many_dimensions():
    rng = np.random.default_rng(1)
    features = np.cumsum(rng.normal(0, 0.02, (1500, 40)), axis=0) % 0.7
    tolerance = np.radians(5)
    kept = thin_poses(features, tolerance)
    assert kept.tolist() == thin_slowly(features, tolerance)
    assert 100 < len(kept) < 1500


def test_time_grows_with_the_number_of_poses_not_its_square():
    rng = np.random.default_rng(2)
    walk = np.cumsum(rng.normal(0, 0.03, (80_000, 50)), axis=0) % 2.0
    thin_poses(walk[:100], 0.1)

    def seconds(count: int) -> float:
        start = time.process_time()  # whatever else the machine does
        thin_poses(walk[:count], 0.1)
        return time.process_time() - start

    few, many = (min(seconds(count) for _ in range(4)) for count in (20_000, 80_000))
    # Four times the poses; a pairwise search would take sixteen times as long.
    assert many < 10 * few


@pytest.mark.parametrize(
    ("features", "tolerance", "message"),
    [
        (np.zeros(3), 0.1, r"features_rad must be \(N, K\), got \(3,\)"),
        (np.zeros((3, 2)), 0.0, "tolerance_rad must be greater than 0"),
        (np.full((3, 2), np.nan), 0.1, "NaN"),
    ],
)
def test_mistakes_are_named(features, tolerance, message):
    with pytest.raises(ValueError, match=message):
        thin_poses(features, tolerance)


def test_features_do_not_know_where_the_body_stands_and_faces():
    motion = waving()
    features = pose_features(motion)
    np.testing.assert_allclose(features[:, :-2], motion.angles_rad)
    np.testing.assert_allclose(features[:, -2:], 0, atol=1e-12)  # it turns about the vertical only


def test_leaning_is_a_feature():
    motion = waving(3)
    lean, heading = np.radians(20), np.radians(50)
    tilt = np.array([np.cos(lean / 2), np.sin(lean / 2), 0, 0])
    turn = np.array([np.cos(heading / 2), 0, 0, np.sin(heading / 2)])
    both = np.array([turn[0] * tilt[0], turn[0] * tilt[1], turn[3] * tilt[1], turn[3] * tilt[0]])
    motion.root_quaternion[:] = both
    np.testing.assert_allclose(
        pose_features(motion)[:, -2:], np.tile([lean, 0], (3, 1)), atol=1e-12
    )
    np.testing.assert_allclose(split_heading(motion.root_quaternion)[0], heading)


def test_step_sizes_hold_the_spacing_of_the_library():
    """A step is between the nearest samples, of which each is off by the quantisation."""
    motion = waving(40, fps=30.0)
    spacing = np.linspace(0.0, 0.02, motion.angles_rad.shape[1])
    settings = LibrarySettings(2400)
    sigma, root = motion_sigmas([motion], (spacing, 0.03), settings)
    change = np.square(np.diff(motion.angles_rad, axis=0)).mean(axis=0)
    least = np.radians(MOTION_MODEL.least_sigma_deg)
    expected = np.maximum(np.sqrt(change + 2 * spacing), least)
    np.testing.assert_allclose(sigma, expected, rtol=1e-5)
    assert root > np.sqrt(2 * 0.03 / 3)
