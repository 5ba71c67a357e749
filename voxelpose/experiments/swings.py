"""Was an arm's swing followed? The criterion by which the arm-swing experiment counts."""

from __future__ import annotations

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
_WHOLE = 0.9  # of a swing, for the first and the last to count


@dataclass(frozen=True)
class Criterion:
    """What counts as followed; the paper counted by eye.

    Attributes: follows: correlation of the estimated with the true angle over a swing, from which
        the arm is said to go to and fro with it. range_share: how much of the true range of angles
        the estimate must cover for that: an arm that trembles in step is not followed. mean_deg:
        mean error under which a followed swing is a success; about two frames' motion of the
        paper's arm and of swing1's, and
            what one sees at a glance in a picture of 240 lines.
        largest_deg: likewise the largest error: an arm shown before the trunk while it is behind it
            is an error, however short.
    """

    follows: float = 0.7
    range_share: float = 0.5
    mean_deg: float = 20.0
    largest_deg: float = 60.0


def arm_angles(
    joints_m: NDArray[np.floating], side: Literal["right", "left"] = "right"
) -> NDArray[np.float64]:
    """Measures how far an upper arm is swung about the body's transverse axis, the line through
    both shoulders.

    Args:
        joints_m: (T, 15, 3) in the order of LANDMARK_NAMES, world, z up.
        side: whose arm.

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
    """Divides an arm's course into swings to and fro, each from one hindmost angle to the next.

    Raises:
        InputError: the arm does not swing.
    """
    spread = (
        float(np.nanmax(truth_deg) - np.nanmin(truth_deg)) if np.isfinite(truth_deg).any() else 0.0
    )
    if spread < _LEAST_SWING_DEG:
        raise InputError(
            f"the right arm moves by {spread:.0f} degrees only: the experiment wants a recording of"
            " an arm that swings"
        )
    turns = find_peaks(-truth_deg, prominence=0.5 * spread)[0].tolist()
    if not turns:
        return [slice(0, len(truth_deg))]
    length = int(np.median(np.diff(turns))) if len(turns) > 1 else turns[0]
    # A recording that begins or ends at the hindmost angle has no turning point there.
    first = [0] if turns[0] >= _WHOLE * length else []
    last = [len(truth_deg)] if len(truth_deg) - turns[-1] >= _WHOLE * length else []
    return [slice(a, b) for a, b in pairwise(first + turns + last)]


def judge(
    truth_deg: NDArray[np.floating],
    estimate_deg: NDArray[np.floating],
    criterion: Criterion | None = None,
) -> Verdict:
    """Judges one swing.

    Args:
        truth_deg, estimate_deg: (T,) angles; NaN in the estimate where there is no pose.
        criterion: see Criterion.

    Returns: "success": the arm goes to and fro with the true one, at the right angle. "error": it
        does, at a wrong angle. "fail": it does not.
    """
    criterion = criterion or Criterion()
    error = np.abs((estimate_deg - truth_deg + 180.0) % 360.0 - 180.0)
    if not np.isfinite(error).all() or np.std(estimate_deg) < 1e-9:
        return "fail"
    # Angles are taken near the truth's, so that an arm at 179 and one at -179 degrees do not count
    # as far apart.
    near = truth_deg + (estimate_deg - truth_deg + 180.0) % 360.0 - 180.0
    together = float(np.corrcoef(truth_deg, near)[0, 1])
    if together < criterion.follows or np.ptp(near) < criterion.range_share * np.ptp(truth_deg):
        return "fail"
    return (
        "success"
        if error.mean() < criterion.mean_deg and error.max() < criterion.largest_deg
        else "error"
    )


def count(
    truth_deg: NDArray[np.floating], estimate_deg: NDArray[np.floating], swings: Sequence[slice]
) -> dict[Verdict, int]:
    """Counts the verdicts over all swings."""
    found = [judge(truth_deg[swing], estimate_deg[swing]) for swing in swings]
    return {verdict: found.count(verdict) for verdict in VERDICTS}
