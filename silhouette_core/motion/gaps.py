"""Frames without a pose between others: how many may be filled, and with which poses."""

import math
import re
from collections.abc import Sequence

import numpy as np

from calib.errors import InputError
from silhouette_core.motion.smoothing import continuous_quaternions

GAP_METHODS = "linear", "pchip", "none"
_LIMIT = re.compile(r"(\d{1,9})|(\d{0,9}\.?\d{1,9})\s*s")


def gap_limit_frames(limit: int | str, fps: float) -> int:
    """Number of frames of the longest gap that is filled.

    Args:
        limit: a number of frames, `12`, or seconds, `0.2s`.

    Raises:
        InputError: it is neither.
    """
    found = _LIMIT.fullmatch(str(limit).strip())
    if found is None:
        raise InputError(
            f"gap limit {str(limit)[:40]!r} is not understood: give frames, as in 12, or seconds,"
            " as in 0.2s"
        )
    # The least excess keeps rounding from costing a frame: 0.1 s of 30 frames a second are 3.
    return int(found[1]) if found[1] else math.floor(float(found[2]) * fps + 1e-6)


def frames_in_gaps(frames: np.ndarray, longest: int) -> np.ndarray:
    """Numbers (n,) int64 of missing frames that lie in gaps of at most `longest` frames.

    Args:
        frames: (T,) int64, increasing, frames with a pose.
        longest: frames; a gap is a run of missing ones between two poses.
    """
    missing = np.diff(frames) - 1
    fills = np.flatnonzero((missing > 0) & (missing <= longest))
    filled = [np.arange(frames[row] + 1, frames[row + 1]) for row in fills.tolist()]
    return np.concatenate([np.zeros(0, np.int64), *filled])


def poses_between(
    frames: np.ndarray, arrays: Sequence[np.ndarray], wanted: np.ndarray, method: str
) -> list[np.ndarray]:
    """Interpolated poses: the three arrays with n rows.

    Args:
        frames: (T,) int64, increasing, frames of the known poses.
        arrays: root_m (T, 3), root_quaternion (T, 4) and angles_rad (T, D), float64.
        wanted: (n,) int64, frames within them.
        method: `linear`: straight between the neighbours, rotations about a fixed axis (spherical
            linear interpolation); `pchip`: monotone cubic, which keeps the speeds at both ends.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.spatial.transform import Rotation, Slerp

    root_m, quaternion, angles = arrays
    flat = np.hstack([root_m, angles])
    if method == "linear":
        between = np.column_stack([np.interp(wanted, frames, column) for column in flat.T])
        turns = Slerp(frames, Rotation.from_quat(quaternion, scalar_first=True))(wanted)
        turned = turns.as_quat(canonical=True, scalar_first=True)
    else:
        between = PchipInterpolator(frames, flat)(wanted)
        turned = PchipInterpolator(frames, continuous_quaternions(quaternion))(wanted)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return [between[:, :3], turned, between[:, 3:]]
