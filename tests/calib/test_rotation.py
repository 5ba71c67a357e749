"""Rotation vectors and matrices undo each other at every angle, zero and half a turn included."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.rotation import matrix_from_rodrigues, nearest_rotation, rodrigues_from_matrix

axes = st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3).filter(
    lambda axis: np.linalg.norm(axis) > 0.01
)
angles = st.one_of(st.floats(0, np.pi), st.sampled_from([0.0, 1e-12, 1e-7, np.pi - 1e-7, np.pi]))


@given(axes, angles)
def test_vector_and_matrix_undo_each_other(axis, angle):
    vector = np.array(axis) / np.linalg.norm(axis) * angle
    matrix = matrix_from_rodrigues(vector)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(matrix, cv2.Rodrigues(vector)[0], atol=1e-12)
    np.testing.assert_allclose(
        matrix_from_rodrigues(rodrigues_from_matrix(matrix)), matrix, atol=1e-14
    )
    if angle < np.pi - 1e-6:
        np.testing.assert_allclose(rodrigues_from_matrix(matrix), vector, atol=1e-13)


def test_nearest_rotation_corrects_rounding_and_never_mirrors():
    matrix = matrix_from_rodrigues([0.3, -1.0, 2.0])
    np.testing.assert_allclose(nearest_rotation(matrix.round(3)), matrix, atol=1e-3)
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1, -1]))) == pytest.approx(1)
