"""Thinning of poses to a least distance."""

import numpy as np
from numpy.typing import NDArray

from calib.checks import float_array
from silhouette_core.monocular.making.kernels.thinning import thin_rows
from silhouette_core.motion.heading import split_heading
from silhouette_core.motion.motion import Motion

_GRID_COLUMNS = 6


def pose_features(motion: Motion) -> NDArray[np.float64]:
    """Coordinates of poses that do not depend on heading and position.

    Args:
        motion: T poses.

    Returns:
        (T, D + 2) float64, radians: the joint angles, then the lean of the pelvis from the
        vertical, a rotation vector about the body's x and y (its z is 0 without the heading).
    """
    _, tilt = split_heading(motion.root_quaternion)
    sine = np.linalg.norm(tilt[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, tilt[:, :1])
    lean = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0) * tilt[:, 1:3]
    return np.hstack([motion.angles_rad, lean])


def thin_poses(features_rad: NDArray[np.float64], tolerance_rad: float) -> NDArray[np.int64]:
    """Poses of which no two differ by the tolerance or less in all coordinates.

    Greedy in the given order, and exact: a pose is removed if a kept one is within the tolerance in
    every coordinate. Takes N lookups in a hash grid over the six coordinates that vary most, each
    of at most 64 cells; the time grows with N and the number of kept poses per cell, not with N².

    Args:
        features_rad: (N, K) float64, finite, radians or any other unit.
        tolerance_rad: largest difference of similar poses, greater than 0, in the same unit.

    Returns:
        (L,) int64, increasing, the rows that are kept.

    Raises:
        ValueError: the arrays have other shapes, hold NaN, or the tolerance is not positive.

    Source: Okada and Stenger, §3 (their tolerance is 5 degrees).
    """
    features = float_array("features_rad", features_rad, ("N", "K"), finite=True)
    if not tolerance_rad > 0:
        raise ValueError(f"tolerance_rad must be greater than 0, got {tolerance_rad}")
    kept = np.zeros(len(features), bool)
    spread = features.std(axis=0) if len(features) else np.zeros(features.shape[1])
    grid = np.argsort(-spread, kind="stable")[:_GRID_COLUMNS].astype(np.int64)
    thin_rows(features, grid, float(tolerance_rad), kept)
    return np.flatnonzero(kept).astype(np.int64)
