"""Base poses of a library, selected from recorded motion, and the motion's step sizes."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from calib.checks import Float32Array, FloatArray, IndexArray, IntArray, float_array
from calib.errors import InputError
from silhouette_core.monocular.tree.kernels.near_poses import thin_rows
from silhouette_core.monocular.tree.pose_library import BasePoses, LibrarySettings
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.heading import mirrored, split_heading
from silhouette_core.motion.kinematics import forward, landmarks, rotation_matrices
from silhouette_core.motion.motion import Motion

_DRAWN = 2000  # poses whose distance to the nearest base pose is measured
_GRID_COLUMNS = 6


def base_poses(motions: Mapping[str, Motion], settings: LibrarySettings) -> BasePoses:
    """Base poses of a library, thinned from recorded motion. Raises InputError where there is no
    motion.

    Args:
        motions: clips by name, all of one body.

    Returns:
        The base poses: thinned by `settings.tolerance_deg`, then by the positions of the joints
        until there are at most `settings.poses` samples.

    Source: Okada and Stenger, section 7: no two poses remain whose joint angles all differ by 5
    degrees or less. Thinning by positions is ours.
    """
    clips = [(k, False, motion) for k, motion in enumerate(motions.values()) if len(motion)]
    if not clips:
        raise InputError(
            "no poses are left to make a library of: give more motion, or leave less out"
        )
    if settings.mirror:
        clips += [(k, True, mirrored(motion)) for k, _, motion in clips]
    features = np.concatenate([pose_features(motion) for _, _, motion in clips])
    angles = np.concatenate([motion.angles_rad for _, _, motion in clips])
    tilt = np.concatenate([split_heading(motion.root_quaternion)[1] for _, _, motion in clips])
    source = np.concatenate(
        [np.column_stack([np.full(len(motion), k), motion.frames]) for k, _, motion in clips]
    )
    is_mirrored = np.concatenate([np.full(len(motion), flag) for _, flag, motion in clips])
    selected = thin_poses(features, np.radians(settings.tolerance_deg))
    positions = np.concatenate([_joint_positions(motion) for _, _, motion in clips])
    selected, spacing_m = _thin_to(positions, selected, settings.poses // settings.views_count)
    quantisation = _quantisation(features, angles, tilt, selected)
    sigma, root_sigma = motion_sigmas(
        [motion for _, flag, motion in clips if not flag], quantisation, settings
    )
    return BasePoses(
        angles[selected].astype(np.float32),
        tilt[selected].astype(np.float32),
        source[selected].astype(np.int32),
        is_mirrored[selected],
        tuple(motions),
        sigma,
        root_sigma,
        spacing_m,
        len(features),
    )


def pose_features(motion: Motion) -> FloatArray:
    """Coordinates (T, D + 2) of poses that do not depend on heading and position, radians: the
    joint angles, then the lean of the pelvis from the vertical, a rotation vector about the body's
    x and y (its z is 0 without the heading).
    """
    _, tilt = split_heading(motion.root_quaternion)
    sine = np.linalg.norm(tilt[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, tilt[:, :1])
    lean = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0) * tilt[:, 1:3]
    return np.hstack([motion.angles_rad, lean])


def thin_poses(features_rad: FloatArray, tolerance_rad: float) -> IntArray:
    """Poses of which no two differ by the tolerance or less in all coordinates.

    Greedy in the given order, and exact: a pose is removed if a kept one is within the tolerance in
    every coordinate. Takes N lookups in a hash grid over the six coordinates that vary most, each
    of at most 64 cells; the time grows with N and the number of kept poses per cell, not with N².
    Raises ValueError where the arrays have other shapes, hold NaN, or the tolerance is not
    positive.

    Args:
        features_rad: (N, K) float64, finite, radians or any other unit.
        tolerance_rad: largest difference of similar poses, greater than 0, in the same unit.

    Returns:
        (L,) int64, increasing, the rows that are kept.

    Source: Okada and Stenger, §3 (their tolerance is 5 degrees).
    """
    features = float_array("features_rad", features_rad, ("N", "K"), finite=True)
    if not tolerance_rad > 0:
        raise ValueError(f"tolerance_rad must be greater than 0, got {tolerance_rad}")
    selected = np.zeros(len(features), bool)
    spread = features.std(axis=0) if len(features) else np.zeros(features.shape[1])
    grid = np.argsort(-spread, kind="stable")[:_GRID_COLUMNS].astype(np.int64)
    thin_rows(features, grid, float(tolerance_rad), selected)
    return np.flatnonzero(selected).astype(np.int64)


def _joint_positions(motion: Motion) -> FloatArray:
    """Positions of the joints relative to the pelvis, heading removed, (T, 45) m."""
    _, tilt = split_heading(motion.root_quaternion)
    joints = landmarks(
        motion.model, *forward(motion.model, np.zeros((len(motion), 3)), tilt, motion.angles_rad)
    )
    return (joints - joints[:, :1]).reshape(len(motion), -1)


def _thin_to(positions: FloatArray, selected: IndexArray, most: int) -> tuple[IndexArray, float]:
    """Rows of at most `most` poses, thinned by the positions of the joints, and their spacing, m.

    Joint angles would spend the poses on movements that a silhouette does not show, such as the
    twist of an upper arm.
    """
    if len(selected) <= most:
        return selected, 0.0
    low, high = 0.0, 1.0
    rows = thin_poses(positions[selected], high)
    if len(rows) > most:
        return selected[rows[:: -(-len(rows) // most)]], high
    while high - low > 0.002:
        middle = (low + high) / 2
        candidates = thin_poses(positions[selected], middle)
        if len(candidates) <= most:
            high, rows = middle, candidates
        else:
            low = middle
    return selected[rows], high


def _quantisation(
    features: FloatArray, angles: FloatArray, tilt: FloatArray, selected: IndexArray
) -> tuple[FloatArray, float]:
    """Mean squared distance of poses from the nearest base pose, per joint angle (D,) and of the
    orientation, radians squared.
    """
    drawn = np.random.default_rng(0).permutation(len(features))[:_DRAWN]
    library = features[selected]
    square = (library**2).sum(axis=1)
    nearest = selected[
        np.concatenate(
            [
                np.argmin(square - 2 * rows @ library.T, axis=1)
                for rows in np.array_split(features[drawn], 8)
            ]
        )
    ]
    turn = Rotation.from_quat(tilt[drawn], scalar_first=True).inv() * Rotation.from_quat(
        tilt[nearest], scalar_first=True
    )
    return ((angles[drawn] - angles[nearest]) ** 2).mean(axis=0), float(
        (turn.magnitude() ** 2).mean()
    )


def motion_sigmas(
    motions: list[Motion], quantisation: tuple[FloatArray, float], settings: LibrarySettings
) -> tuple[Float32Array, float]:
    """Step sizes of recorded motion within 1 / `dynamics.FPS`, sigma_j of eq. (4).

    A library represents the poses before and after a step by their nearest samples, so twice the
    mean squared distance to the nearest sample is added to the mean squared change.

    Args:
        quantisation: see `_quantisation`.

    Returns:
        Step sizes of the joint angles (D,) float32, at least half a degree, and of the orientation
        about each axis.
    """
    change, turn, count = np.zeros(motions[0].angles_rad.shape[1]), 0.0, 0
    for motion in motions:
        step = max(1, round(motion.fps / FPS))
        if len(motion) <= step:
            continue
        change += ((motion.angles_rad[step:] - motion.angles_rad[:-step]) ** 2).sum(axis=0)
        rotation = Rotation.from_matrix(rotation_matrices(motion.root_quaternion))
        turn += ((rotation[:-step].inv() * rotation[step:]).magnitude() ** 2).sum()
        count += len(motion) - step
    yaw = np.radians(settings.yaw_step_deg) ** 2 / 12
    sigma = np.sqrt(change / max(count, 1) + 2 * quantisation[0])
    root = np.sqrt((turn / max(count, 1) + 2 * (quantisation[1] + yaw)) / 3)
    return np.maximum(sigma, np.radians(MOTION_MODEL.least_sigma_deg)).astype(np.float32), float(
        max(root, np.radians(MOTION_MODEL.least_sigma_deg))
    )
