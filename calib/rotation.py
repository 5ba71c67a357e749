"""Rotation vectors and matrices, numerically stable at every angle."""

import numpy as np
from numpy.typing import ArrayLike

from calib.checks import FloatArray


def matrix_from_rodrigues(vector: ArrayLike) -> FloatArray:
    """Rotation matrix (3, 3) of a rotation vector (3,), rad.

    Source: Rodrigues' formula, R = I + sin(a) [k] + (1 - cos(a)) [k]^2.
    """
    x, y, z = np.asarray(vector, dtype=np.float64).reshape(3)
    angle = float(np.sqrt(x * x + y * y + z * z))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # sinc(a / pi) = sin(a) / a is regular at zero.
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * half * half * (cross @ cross)


def rodrigues_from_matrix(rotation: ArrayLike) -> FloatArray:
    """Rotation vector (3,), rad, of a rotation matrix (3, 3).

    It is computed from the unit quaternion, which is stable up to half a turn.
    """
    r = np.asarray(rotation, dtype=np.float64)
    trace = np.trace(r)
    # The four squared quaternion components times four; dividing by the largest is stable.
    squares = np.array([1 + trace, *(1 - trace + 2 * np.diag(r))])
    largest = int(np.argmax(squares))
    w = np.array([squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    x = np.array([w[1], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]])
    y = np.array([w[2], x[2], squares[2], r[1, 2] + r[2, 1]])
    z = np.array([w[3], x[3], y[3], squares[3]])
    quaternion = (w, x, y, z)[largest]
    quaternion = quaternion / np.linalg.norm(quaternion)
    if quaternion[0] < 0:
        quaternion = -quaternion
    sine = float(np.linalg.norm(quaternion[1:]))
    angle = 2 * np.arctan2(sine, quaternion[0])
    return quaternion[1:] * (angle / sine if sine > 1e-12 else 2.0)


def nearest_rotation(matrix: ArrayLike) -> FloatArray:
    """Rotation (3, 3) nearest to a matrix (3, 3) in the least-squares sense, by SVD."""
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    return u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
