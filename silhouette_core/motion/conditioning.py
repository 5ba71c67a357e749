"""Conditioning of a finished motion: gaps filled, then a low-pass filter; and what was done."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, get_args

import numpy as np

from calib.errors import InputError
from silhouette_core.motion.smoothing import LowPass, continuous_quaternions, runs_of, smooth_runs
from silhouette_core.setting_types import FilterKind, FilterOrder, GapMethod
from silhouette_core.tuning import DYNAMICS

if TYPE_CHECKING:
    from silhouette_core.motion.motion import Motion

_LIMIT = re.compile(r"(\d{1,9})|(\d{0,9}\.?\d{1,9})\s*s")
_NAMES = {
    "butterworth": "Butterworth low-pass",
    "savgol": "Savitzky-Golay low-pass",
    "gaussian": "Gaussian low-pass",
}


@dataclass(frozen=True)
class Conditioning:
    """What is done to the poses of a motion after the estimation."""

    filter: FilterKind = "auto"  #: kind of the filter, as of `LowPass`; `auto`: see `chosen`.
    cutoff_hz: float = DYNAMICS.cutoff_hz  #: its cut-off, Hz: half of the amplitude is left there.
    filter_order: FilterOrder | None = None  #: its order; None: the usual one.
    gap_limit: int | str = 0  #: Longest gap that is filled: frames, or text such as `0.2s`.
    gap_method: GapMethod = "linear"  #: `linear`, `pchip`, or `none`, which fills none.

    def __post_init__(self) -> None:
        """Checks the values. Raises InputError where a value is none that can be used."""
        gap_limit_frames(self.gap_limit, 1.0)
        if self.gap_method not in get_args(GapMethod):
            raise InputError(
                f"no gap method {self.gap_method!r}: choose from {', '.join(get_args(GapMethod))}"
            )
        self.low_pass  # noqa: B018 (checks its values)

    @property
    def low_pass(self) -> LowPass:
        """The filter."""
        return LowPass(self.chosen().filter, float(self.cutoff_hz), self.filter_order)

    def chosen(self, usual: str = LowPass.kind) -> Conditioning:
        """The same, with an estimator's `usual` filter where that is `auto`."""
        return replace(self, filter=usual) if self.filter == "auto" else self

    def longest_gap(self, fps: float) -> int:
        """Frames of the longest gap that is filled."""
        return 0 if self.gap_method == "none" else gap_limit_frames(self.gap_limit, fps)


def conditioned(motion: Motion, conditioning: Conditioning) -> Motion:
    """A motion with its gaps filled and filtered, which keeps the poses as they were. Frames that
    were filled have the quality NaN, False or 0.

    Args:
        motion: as estimated, or conditioned otherwise before: that is undone.
    """
    conditioning = conditioning.chosen()
    source = as_estimated(motion)
    missing = frames_in_gaps(source.frames, conditioning.longest_gap(source.fps))
    result = _with_frames(source, missing, conditioning.gap_method) if len(missing) else source
    root_m, quaternion = result.root_m.copy(), result.root_quaternion.copy()
    angles = result.angles_rad.copy()
    smooth_runs(root_m, quaternion, angles, result.frames, source.fps, conditioning.low_pass)
    result = replace(
        result,
        root_m=root_m,
        root_quaternion=quaternion,
        angles_rad=angles,
        conditioning=conditioning,
    )
    changed = len(missing) or unfiltered_frames(result) < len(result)
    return replace(result, unfiltered=replace(source, quality={})) if changed else result


def as_estimated(motion: Motion) -> Motion:
    """The motion before its conditioning, with its quality."""
    if motion.conditioning is None or motion.unfiltered is None:
        return replace(motion, conditioning=None)
    estimated = ~motion.filled
    quality = {name: array[estimated] for name, array in motion.quality.items()}
    return replace(motion.unfiltered, quality=quality, corrections=motion.corrections)


def _with_frames(motion: Motion, missing: np.ndarray, method: str) -> Motion:
    """The motion with interpolated poses in missing frames."""
    frames = np.union1d(motion.frames, missing)
    filled = np.isin(frames, missing)
    poses = motion.root_m, motion.root_quaternion, motion.angles_rad
    between = poses_between(motion.frames, poses, missing, method)
    root_m, quaternion, angles = (
        _among(filled, old, new) for old, new in zip(poses, between, strict=True)
    )
    return replace(
        motion,
        root_m=root_m,
        root_quaternion=quaternion,
        angles_rad=angles,
        frames=frames,
        time_s=np.interp(frames, motion.frames, motion.time_s),
        filled=filled,
        quality=quality_with_filled(filled, motion.quality),
    )


def quality_with_filled(
    filled: np.ndarray, quality: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Quality of all T frames out of that of the frames with a pose of their own: NaN, False or 0
    in the frames that were filled.

    Args:
        filled: (T,) bool.
        quality: arrays with as many rows as `filled` has False.
    """
    return {
        name: _among(filled, array, np.nan if array.dtype.kind == "f" else 0)
        for name, array in quality.items()
    }


def _among(filled: np.ndarray, old: np.ndarray, new: np.ndarray | float) -> np.ndarray:
    whole = np.empty((len(filled), *old.shape[1:]), old.dtype)
    whole[~filled], whole[filled] = old, new
    return whole


def describe_conditioning(motion: Motion) -> dict[str, object]:
    """What was done to a motion, for summary.json and exports; empty where it was not recorded.

    Returns:
        The filter with its cut-off, order and, where it has them, frames of its window or its
        standard deviation; how many frames it left unfiltered and why; the longest gap that was
        filled, the method, the numbers of the filled frames, and how many are left; and all of it
        in `words`. Of a motion at another rate, of the one that it was sampled from.
    """
    motion = motion.sampled_from or motion
    done = motion.conditioning
    if done is None:
        return {}
    low_pass, missing = done.low_pass, np.diff(motion.frames) - 1
    settings: dict[str, object] = {}
    if done.filter != "none":
        settings = {"cutoff_hz": low_pass.cutoff_hz, "order": low_pass.usual_order}
    if done.filter == "savgol":
        settings["window_frames"] = low_pass.window(motion.fps)
    if done.filter == "gaussian":
        settings["sigma_frames"] = round(low_pass.sigma(motion.fps), 3)
    return {
        "filter": done.filter,
        **settings,
        "frames_unfiltered": unfiltered_frames(motion),
        "gap_limit_frames": done.longest_gap(motion.fps),
        "gap_method": done.gap_method,
        "frames_filled": motion.frames[motion.filled].tolist(),
        "frames_left": int(missing.sum()),
        "words": conditioning_words(motion),
    }


def unfiltered_frames(motion: Motion) -> int:
    """Number of poses that the filter did not change."""
    low_pass = LowPass() if motion.conditioning is None else motion.conditioning.low_pass
    lengths = [len(run) for run in runs_of(motion.frames)]
    return sum(length for length in lengths if not low_pass.acts(length, motion.fps))


def filter_warning(motion: Motion) -> str:
    """Why a filter that was asked for did not act on some frames; empty where it acted on all."""
    done = motion.conditioning
    if done is None or done.filter == "none" or not unfiltered_frames(motion):
        return ""
    low_pass, fps = done.low_pass, motion.fps
    if low_pass.too_slow(fps):
        usable = math.floor(4 * fps) / 10
        return (
            f"not filtered: {fps:g} frames per second are too few for a cut-off of"
            f" {low_pass.cutoff_hz:g} Hz (a cut-off of at most {usable:g} Hz would act)"
        )
    return (
        f"{unfiltered_frames(motion)} of {len(motion)} frames are not filtered: they are in runs"
        f" shorter than the {low_pass.shortest(fps)} frames that the filter needs"
    )


def conditioning_words(motion: Motion) -> str:
    """What was done to a motion, in one line."""
    motion = motion.sampled_from or motion
    done, missing = motion.conditioning, int((np.diff(motion.frames) - 1).sum())
    words = [f"corrected by hand: {', '.join(motion.corrections)}"] if motion.corrections else []
    if done is None:
        return "; ".join([*words, "filter not recorded"])
    words += [_filter_words(done), filter_warning(motion)]
    if motion.filled.any():
        words.append(
            f"{motion.filled.sum()} missing frames filled ({done.gap_method}, gaps up to"
            f" {done.longest_gap(motion.fps)} frames)"
        )
    if missing:
        words.append(f"{missing} missing frames left")
    return "; ".join(word for word in words if word)


def _filter_words(done: Conditioning) -> str:
    if done.filter == "none":
        return "no filter"
    order = {
        "butterworth": f", order {done.low_pass.usual_order}, forward and backward",
        "savgol": f", polynomial of degree {done.low_pass.usual_order}",
    }.get(done.filter, "")
    return f"{_NAMES[done.filter]}, {done.cutoff_hz:g} Hz{order}"


def gap_limit_frames(limit: int | str, fps: float) -> int:
    """Number of frames of the longest gap that is filled. Raises InputError where it is neither.

    Args:
        limit: a number of frames, `12`, or seconds, `0.2s`.
    """
    parsed = _LIMIT.fullmatch(str(limit).strip())
    if parsed is None:
        raise InputError(
            f"gap limit {str(limit)[:40]!r} is not understood: give frames, as in 12, or seconds,"
            " as in 0.2s"
        )
    # The least excess keeps rounding from costing a frame: 0.1 s of 30 frames a second are 3.
    return int(parsed[1]) if parsed[1] else math.floor(float(parsed[2]) * fps + 1e-6)


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
