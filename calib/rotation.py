"""Rotation vectors and matrices."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray


def matrix_from_rodrigues(vector: ArrayLike) -> FloatArray:
    """Rotation matrix (3, 3) of a rotation vector (3,), rad."""
    return Rotation.from_rotvec(np.asarray(vector, dtype=np.float64).reshape(3)).as_matrix()


def rodrigues_from_matrix(rotation: ArrayLike) -> FloatArray:
    """Rotation vector (3,), rad, of a rotation matrix (3, 3)."""
    return Rotation.from_matrix(rotation).as_rotvec()


def matrix_from_quaternion(wxyz: ArrayLike) -> FloatArray:
    """Rotation matrix (3, 3) of a quaternion (4,) w, x, y, z of any length but 0."""
    return Rotation.from_quat(np.roll(np.asarray(wxyz, dtype=np.float64), -1)).as_matrix()


def nearest_rotation(matrix: ArrayLike) -> FloatArray:
    """Rotation (3, 3) nearest to a matrix (3, 3) in the least-squares sense, by SVD."""
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    return u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
