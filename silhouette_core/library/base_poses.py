"""Base poses: which recorded poses a library is made of, and how fast they change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from silhouette_core.library.pose_library import LibrarySettings
from silhouette_core.library.thinning import pose_features, thin_poses
from silhouette_core.motion.heading import mirrored, split_heading
from silhouette_core.motion.kinematics import forward, landmarks, rotation_matrices
from silhouette_core.motion.motion import Motion

_FPS = 30.0
_LEAST_SIGMA_RAD = np.radians(0.5)
_WIDEST_M = 1.0
_DRAWN = 2000


@dataclass(frozen=True, eq=False)
class BasePoses:
    """B base poses.

    Attributes: angles: (B, D) float32, joint angles, radians. quaternion: (B, 4) float32, w x y z,
        orientation of the pelvis, heading removed. source: (B, 2) int32, clip and frame. mirrored:
        (B,) bool. clips: names of the clips. spacing_m: how far apart, along some axis, some joint
        of any two is at least, where 5 degrees left too many; else 0. frames: how many poses there
        were before thinning. sigma_rad: (D,) float32 and root_sigma_rad: see `motion_sigmas`.
    """

    angles: NDArray[np.float32]
    quaternion: NDArray[np.float32]
    source: NDArray[np.int32]
    mirrored: NDArray[np.bool_]
    clips: tuple[str, ...]
    spacing_m: float
    frames: int
    sigma_rad: NDArray[np.float32]
    root_sigma_rad: float


def base_poses(motions: Mapping[str, Motion], settings: LibrarySettings) -> BasePoses:
    """Thins recorded motion to the base poses of a library.

    Args: motions: clips by name, all of one body. settings: how many samples at most, from how many
        views, the least tolerance, mirror images or not.

    Returns: The base poses: thinned by `settings.tolerance_deg`, then by the places of the joints
        until the samples are not too many.

    Raises:
        InputError: there is no motion.

    Source: Okada and Stenger, section 7: no two poses whose joint angles all differ by 5 degrees or
    less.
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
    turned = np.concatenate([np.full(len(motion), flag) for _, flag, motion in clips])
    kept = thin_poses(features, np.radians(settings.tolerance_deg))
    places = np.concatenate([_places(motion) for _, _, motion in clips])
    kept, tolerance = _thin_to(places, kept, settings.poses // settings.views_count)
    quantised = _quantisation(features, angles, tilt, kept)
    sigma, root_sigma = motion_sigmas(
        [motion for _, flag, motion in clips if not flag], quantised, settings
    )
    return BasePoses(
        angles[kept].astype(np.float32),
        tilt[kept].astype(np.float32),
        source[kept].astype(np.int32),
        turned[kept],
        tuple(motions),
        tolerance,
        len(features),
        sigma,
        root_sigma,
    )


def _places(motion: Motion) -> NDArray[np.float64]:
    """Returns where the joints are, (T, 45) m, seen from the pelvis, heading removed."""
    _, tilt = split_heading(motion.root_quaternion)
    joints = landmarks(
        motion.model, *forward(motion.model, np.zeros((len(motion), 3)), tilt, motion.angles_rad)
    )
    return (joints - joints[:, :1]).reshape(len(motion), -1)


def _thin_to(
    places: NDArray[np.float64], kept: NDArray[np.integer], most: int
) -> tuple[NDArray[np.integer], float]:
    """Thins further, by where the joints are: the least distance (m, along each axis) at which at
    most `most` poses are left.

    Joint angles would spend the poses on what a silhouette does not show, such as the twist of an
    upper arm.
    """
    if len(kept) <= most:
        return kept, 0.0
    low, high, found = 0.0, _WIDEST_M, thin_poses(places[kept], _WIDEST_M)
    if len(found) > most:
        return kept[found[:: -(-len(found) // most)]], _WIDEST_M
    while high - low > 0.02 * _WIDEST_M / 10:
        middle = (low + high) / 2
        some = thin_poses(places[kept], middle)
        if len(some) <= most:
            high, found = middle, some
        else:
            low = middle
    return kept[found], high


def _quantisation(
    features: NDArray[np.float64],
    angles: NDArray[np.float64],
    tilt: NDArray[np.float64],
    kept: NDArray[np.integer],
) -> tuple[NDArray[np.float64], float]:
    """Returns how far poses are from the nearest base pose: mean squares per joint angle (D,) and
    of the orientation's angle.
    """
    drawn = np.random.default_rng(0).permutation(len(features))[:_DRAWN]
    library = features[kept]
    square = (library**2).sum(axis=1)
    nearest = kept[
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
    motions: list[Motion], quantised: tuple[NDArray[np.float64], float], settings: LibrarySettings
) -> tuple[NDArray[np.float32], float]:
    """Measures sigma_j of eq. (4) on recorded motion at 30 frames a second.

    A library knows poses only as near as its nearest sample, before a step as after it, so to the
    mean square of the recorded change twice that of the distance to the nearest sample is added.

    Args: motions: the clips. quantised: mean squares of the distance to the nearest base pose, per
        joint angle (D,), and of the orientation, radians squared. settings: for the yaw step.

    Returns:
        sigma_rad (D,) float32, at least half a degree, and root_sigma_rad for each of three axes.
    """
    change, turn, count = np.zeros(motions[0].angles_rad.shape[1]), 0.0, 0
    for motion in motions:
        step = max(1, round(motion.fps / _FPS))
        if len(motion) <= step:
            continue
        change += ((motion.angles_rad[step:] - motion.angles_rad[:-step]) ** 2).sum(axis=0)
        rotation = Rotation.from_matrix(rotation_matrices(motion.root_quaternion))
        turn += ((rotation[:-step].inv() * rotation[step:]).magnitude() ** 2).sum()
        count += len(motion) - step
    yaw = np.radians(settings.yaw_step_deg) ** 2 / 12
    sigma = np.sqrt(change / max(count, 1) + 2 * quantised[0])
    root = np.sqrt((turn / max(count, 1) + 2 * (quantised[1] + yaw)) / 3)
    return np.maximum(sigma, _LEAST_SIGMA_RAD).astype(np.float32), float(
        max(root, _LEAST_SIGMA_RAD)
    )
