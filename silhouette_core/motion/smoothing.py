"""Poses without the jitter: a low-pass filter over the finished take, forward and backward, so that
nothing lags.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

# voluntary human movement holds little power above 6 Hz (Winter, Biomechanics and Motor Control)
_CUTOFF_HZ = 7.0
_ORDER = 2
_SHORTEST = 16


def smooth(values: np.ndarray, fps: float) -> np.ndarray:
    """Smooths evenly sampled signals without lag (Butterworth, run both ways).

    Args: values: (T, n) float64. fps: samples per second. Slow recordings, which hold nothing above
        the cut-off, are given back as they are.

    Returns:
        (T, n) float64.
    """
    if len(values) < _SHORTEST or 0.4 * fps < _CUTOFF_HZ:
        return values
    return sosfiltfilt(butter(_ORDER, _CUTOFF_HZ, fs=fps, output="sos"), values, axis=0)


def smooth_quaternions(quaternions: np.ndarray, fps: float) -> np.ndarray:
    """Smooths rotations (T, 4) w, x, y, z likewise, and returns unit quaternions."""
    signs = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(1) < 0, -1.0, 1.0))
    continuous = quaternions * np.concatenate([[1.0], signs])[:, None]
    smoothed = smooth(continuous, fps)
    return smoothed / np.linalg.norm(smoothed, axis=1, keepdims=True)
