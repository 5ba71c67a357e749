"""The motion models against the dense formula (4), (5)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.monocular.tree.transitions import find_neighbours, transitions
from tests.silhouette_core.monocular.tree.small_library import small_library


@pytest.fixture(scope="module")
def made():
    return small_library(pitches_deg=(0.0, 15.0))


def dense_squares(library, occlusion_aware):
    """Squared distances in sigmas between all samples, infinite between pitches."""
    turn, angles = library.pose(np.arange(len(library)))
    rotation = Rotation.from_quat(turn, scalar_first=True)
    pitch = library.views[library.sample_view, 1]
    result = np.full((len(library), len(library)), np.inf)
    for i in range(len(library)):
        occluded = library.occluded[i] if occlusion_aware else np.zeros(27, bool)
        sigma = library.bases.sigma_rad * np.where(occluded[library.model.tree.dof_part], 5, 1)
        root = library.bases.root_sigma_rad * (5 if occluded[0] else 1)
        apart = (((angles - angles[i]) / sigma) ** 2).sum(1) + (
            (rotation[i].inv() * rotation).magnitude() / root
        ) ** 2
        result[i] = np.where(pitch == pitch[i], apart, np.inf)
    return result


@pytest.mark.parametrize("occlusion_aware", [False, True])
def test_all_neighbours_give_the_dense_matrix(made, occlusion_aware):
    library = replace(made, neighbours=find_neighbours(made, occlusion_aware, count=len(made)))
    sigma_scale = 4.0
    gauss = np.exp(-dense_squares(made, occlusion_aware) / (2 * sigma_scale**2))
    expected = gauss / gauss.sum(1, keepdims=True)
    result = transitions(library, occlusion_aware, sigma_scale, neighbours=len(made)).toarray()
    np.testing.assert_allclose(result, expected, rtol=2e-3, atol=1e-6)
    assert np.count_nonzero(expected > 1e-3) > 3 * len(made)


@pytest.mark.parametrize("occlusion_aware", [False, True])
def test_the_nearest_are_kept_with_their_weights(made, occlusion_aware):
    library = replace(made, neighbours=find_neighbours(made, occlusion_aware, count=12))
    squares = dense_squares(made, occlusion_aware)
    name = "dm2" if occlusion_aware else "dm1"
    np.testing.assert_allclose(
        library.neighbours[f"{name}.square"], np.sort(squares, axis=1)[:, :12], rtol=1e-4, atol=1e-3
    )
    matrix = transitions(library, occlusion_aware, sigma_scale=3.0)
    assert matrix.shape == (len(made), len(made)) and matrix.nnz == 12 * len(made)
    np.testing.assert_allclose(np.asarray(matrix.sum(1)).ravel(), 1, rtol=1e-5)
    # Staying is most likely.
    assert (matrix.diagonal() >= matrix.max(axis=1).toarray().ravel() - 1e-6).all()


def test_without_normalising_the_nearest_weigh_the_same_from_everywhere(made):
    plain, shared = (
        transitions(made, True, 4.0, normalised=flag).toarray() for flag in (False, True)
    )
    np.testing.assert_allclose(plain.diagonal(), 1)
    np.testing.assert_allclose(
        plain / plain.sum(axis=1, keepdims=True), shared, rtol=1e-4, atol=1e-6
    )


def test_variances_grow_in_proportion_to_the_frame_interval(made):
    half_rate, wider = (
        transitions(made, True, 4.0, interval_s=2 / 30),
        transitions(made, True, 4.0 * np.sqrt(2)),
    )
    np.testing.assert_allclose(half_rate.toarray(), wider.toarray(), rtol=1e-5)


def test_parts_that_show_little_are_hidden(made):
    share = made.areas / np.percentile(made.areas, 99, axis=0)
    assert (made.occluded == (share < 0.15)).all()
    assert made.areas.dtype == np.uint16
