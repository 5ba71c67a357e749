import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from silhouette_core.image.spans import Spans
from silhouette_core.scoring.backend import Voxels, signed_prefix
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.reference import ReferenceBackend

REFERENCE = ReferenceBackend()


def overlap_case(seed, points, placements):
    rng = np.random.default_rng(seed)
    voxels = Voxels(
        rng.random(tuple(rng.integers(1, 14, 3))) > 0.4,
        rng.normal(size=3),
        float(rng.uniform(0.02, 0.3)),
    )
    rotations = Rotation.random(placements, random_state=seed).as_matrix().reshape(-1, 3, 3)
    middle = voxels.origin_m + 0.5 * voxels.voxel_size_m * np.array(voxels.occupancy.shape)
    return (
        voxels,
        rng.normal(size=(points, 3)),
        rng.random(points),
        rotations,
        middle + rng.normal(size=(placements, 3)),
    )


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    points=st.integers(0, 60),
    placements=st.integers(1, 20),
    threads=st.integers(1, 4),
)
def test_voxel_overlap_is_the_references_bit_for_bit(seed, points, placements, threads):
    case = overlap_case(seed, points, placements)
    expected = REFERENCE.voxel_overlap(*case)
    found = CpuBackend(threads).voxel_overlap(*case)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(expected[0] + expected[1], case[2].sum(), atol=1e-12)


def test_a_part_overlaps_where_it_was_cut_out():
    occupancy = np.zeros((10, 10, 10), bool)
    occupancy[2:5, 3:6, 4:8] = True
    voxels = Voxels(occupancy, np.array([0.5, 0.0, -0.5]), 0.1)
    points = (np.argwhere(occupancy) + 0.5) * 0.1
    shifts = voxels.origin_m + np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0.2], [5.0, 0, 0]])
    rotations = np.repeat(np.eye(3)[None], 4, axis=0)
    inside, outside = CpuBackend().voxel_overlap(voxels, points, np.ones(36), rotations, shifts)
    np.testing.assert_array_equal(inside, [36, 24, 18, 0])
    np.testing.assert_array_equal(outside, [0, 12, 18, 36])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 6), threads=st.integers(1, 4))
def test_span_distance_is_the_weighted_disagreement(seed, count, threads):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 30, 2))
    observation, weights = rng.random(shape) > 0.5, rng.random(shape)
    masks = [rng.random(shape) > rng.random() for _ in range(count)]
    prefix, base = signed_prefix(observation, weights)
    spans = Spans.from_masks(masks)
    expected = REFERENCE.span_distance(prefix, base, spans)
    np.testing.assert_array_equal(CpuBackend(threads).span_distance(prefix, base, spans), expected)
    np.testing.assert_allclose(
        expected, [weights[mask ^ observation].sum() for mask in masks], atol=1e-9
    )


def test_arrays_that_do_not_belong_together_are_refused():
    voxels, points, weights, rotations, translations = overlap_case(0, 5, 3)
    backend = CpuBackend()
    for wrong, message in [
        (
            (voxels, points[:, :2], weights, rotations, translations),
            r"points must be \(P, 3\), got \(5, 2\)",
        ),
        ((voxels, points, weights[1:], rotations, translations), r"weights must be \(5,\)"),
        ((voxels, points, weights, rotations[0], translations), r"rotations must be \(K, 3, 3\)"),
        ((voxels, points, weights, rotations, translations[1:]), r"translations must be \(3, 3\)"),
    ]:
        with pytest.raises(ValueError, match=message):
            backend.voxel_overlap(*wrong)
    with pytest.raises(
        TypeError, match=r"occupancy must be \(nx, ny, nz\) bool, got \(2, 2, 2\) float64"
    ):
        Voxels(np.zeros((2, 2, 2)), np.zeros(3), 0.1)
    prefix, base = signed_prefix(np.zeros((4, 5), bool), np.ones((4, 5)))
    with pytest.raises(ValueError, match="reaches out of the image of 4 rows and 5 columns"):
        backend.span_distance(prefix, base, Spans.from_masks([np.ones((4, 6), bool)]))
    with pytest.raises(ValueError, match="offsets must rise"):
        Spans(np.zeros(1, np.int32), np.zeros(1, np.int32), np.ones(1, np.int32), np.array([0, 2]))
    with pytest.raises(ValueError, match="threads must be at least 1"):
        CpuBackend(0)


def test_the_callers_number_of_threads_is_put_back():
    before = numba.get_num_threads()
    CpuBackend(1).voxel_overlap(*overlap_case(1, 3, 2))
    assert numba.get_num_threads() == before
