"""Success criterion of the arm-swing experiment."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_NAMES

Verdict = Literal["fail", "error", "success"]
VERDICTS: tuple[Verdict, ...] = ("fail", "error", "success")
_UP = np.array([0.0, 0.0, 1.0])
_LEAST_SWING_DEG = 30.0
_WHOLE = 0.9  # fraction of a swing from which the first and the last count


@dataclass(frozen=True)
class Criterion:
    """When a swing counts as tracked; the paper's authors counted by eye.

    Attributes:
        follows: least correlation of estimated and true angle over a swing that is tracked.
        range_share: fraction of the true range of angles that the estimate must cover: small
            movements in phase do not count.
        mean_deg: largest mean error of a success: about two frames' motion of the paper's arm and
            of swing1's, and visible in a picture of 240 lines.
        largest_deg: largest error in a single frame of a success: an arm before the trunk instead
            of behind it is an error, however short.
    """

    follows: float = 0.7
    range_share: float = 0.5
    mean_deg: float = 20.0
    largest_deg: float = 60.0


def arm_angles(
    joints_m: NDArray[np.floating], side: Literal["right", "left"] = "right"
) -> NDArray[np.float64]:
    """Angle of an upper arm about the body's transverse axis, the line through both shoulders.

    Args:
        joints_m: (T, 15, 3) metres, in the order of LANDMARK_NAMES, world, z up.
        side: of the arm.

    Returns:
        (T,) degrees: 0 hanging, 90 level and forward, below 0 backward; NaN where a joint is.
    """
    joint = lambda name: joints_m[:, LANDMARK_NAMES.index(name)]  # noqa: E731
    across = joint("left_shoulder") - joint("right_shoulder")
    across = across / np.linalg.norm(across, axis=1, keepdims=True)
    forward = np.cross(across, _UP)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    arm = joint(f"{side}_elbow") - joint(f"{side}_shoulder")
    down = -np.cross(forward, across)
    return np.degrees(np.arctan2((arm * forward).sum(axis=1), (arm * down).sum(axis=1)))


def split_swings(truth_deg: NDArray[np.floating]) -> list[slice]:
    """Divides an arm's motion into swings back and forth, each between two backmost angles.

    Raises:
        InputError: the arm does not swing.
    """
    known = truth_deg[np.isfinite(truth_deg)]
    extent = float(np.ptp(known)) if len(known) else 0.0
    if extent < _LEAST_SWING_DEG:
        raise InputError(
            f"the right arm moves by {extent:.0f} degrees only: the experiment wants a recording of"
            " an arm that swings"
        )
    turns = find_peaks(-truth_deg, prominence=0.25 * extent)[0].tolist()
    if not turns:
        return [slice(0, len(truth_deg))]
    length = int(np.median(np.diff(turns))) if len(turns) > 1 else turns[0]
    # A recording that begins or ends at the backmost angle has no turning point there.
    first = [0] if turns[0] >= _WHOLE * length else []
    last = [len(truth_deg)] if len(truth_deg) - turns[-1] >= _WHOLE * length else []
    return [slice(a, b) for a, b in pairwise(first + turns + last)]


def judge(
    truth_deg: NDArray[np.floating],
    estimate_deg: NDArray[np.floating],
    criterion: Criterion | None = None,
) -> Verdict:
    """Verdict on one swing.

    Args:
        truth_deg: (T,) true angles.
        estimate_deg: (T,) estimated angles; NaN where there is no pose.
        criterion: see Criterion.

    Returns:
        "success": the arm swings with the true one, at the right angle. "error": it does, at a
        wrong angle. "fail": it does not.
    """
    criterion = criterion or Criterion()
    error = np.abs((estimate_deg - truth_deg + 180.0) % 360.0 - 180.0)
    if not np.isfinite(error).all() or np.std(estimate_deg) < 1e-9:
        return "fail"
    # Angles are unwrapped toward the truth's: 179 and -179 degrees are near each other.
    near = truth_deg + (estimate_deg - truth_deg + 180.0) % 360.0 - 180.0
    correlation = float(np.corrcoef(truth_deg, near)[0, 1])
    if correlation < criterion.follows or np.ptp(near) < criterion.range_share * np.ptp(truth_deg):
        return "fail"
    success = error.mean() < criterion.mean_deg and error.max() < criterion.largest_deg
    return "success" if success else "error"


def count(
    truth_deg: NDArray[np.floating], estimate_deg: NDArray[np.floating], swings: Sequence[slice]
) -> dict[Verdict, int]:
    """Number of swings by verdict."""
    verdicts = [judge(truth_deg[swing], estimate_deg[swing]) for swing in swings]
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}
