"""Zero-phase low-pass filter over the poses of a finished motion."""

from __future__ import annotations

import numpy as np

# Voluntary human movement has little power above 6 Hz (Winter, Biomechanics and Motor Control).
_CUTOFF_HZ = 7.0
_ORDER = 2
_SHORTEST = 16  # frames


def smooth(values: np.ndarray, fps: float) -> np.ndarray:
    """Smooths evenly sampled signals without lag: a Butterworth filter forward and backward.

    Args:
        values: (T, n) float64.
        fps: samples per second. Signals below the cut-off, of low frame rates, are returned
            unchanged.

    Returns:
        (T, n) float64.
    """
    if len(values) < _SHORTEST or 0.4 * fps < _CUTOFF_HZ:
        return values
    # Imported here, since that takes a second, and only finished motions are smoothed.
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(_ORDER, _CUTOFF_HZ, fs=fps, output="sos"), values, axis=0)


def smooth_quaternions(quaternions: np.ndarray, fps: float) -> np.ndarray:
    """Smooths rotations (T, 4), unit quaternions w, x, y, z, like `smooth`."""
    signs = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(1) < 0, -1.0, 1.0))
    continuous = quaternions * np.concatenate([[1.0], signs])[:, None]
    smoothed = smooth(continuous, fps)
    return smoothed / np.linalg.norm(smoothed, axis=1, keepdims=True)


def smooth_runs(
    root_m: np.ndarray,
    root_quaternion: np.ndarray,
    angles_rad: np.ndarray,
    frames: np.ndarray,
    fps: float,
) -> None:
    """Smooths poses in place, each run of consecutive frames on its own.

    Args:
        root_m: (T, 3) float64.
        root_quaternion: (T, 4) float64.
        angles_rad: (T, D) float64.
        frames: (T,) int64, increasing frame numbers; a run ends where one is missing.
        fps: frames per second.
    """
    for run in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames) > 1) + 1):
        root_m[run], angles_rad[run] = smooth(root_m[run], fps), smooth(angles_rad[run], fps)
        root_quaternion[run] = smooth_quaternions(root_quaternion[run], fps)
