"""What is handed on of a motion: some frames, at another rate, on the spot, on another skeleton."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.errors import InputError
from silhouette_core.motion.conditioning import poses_between
from silhouette_core.motion.motion import Motion
from silhouette_core.setting_types import SkeletonName


@dataclass(frozen=True)
class Excerpt:
    """What of a motion is written, and on which skeleton."""

    frames: tuple[int | None, int | None] | None = None
    """First frame of the recording and one past the last, None for the ends; None: all."""
    rate_hz: float | None = None  #: Frames per second; None: those of the recording.
    in_place: bool = False  #: Whether the pelvis stays above the origin.
    skeleton: SkeletonName = "voxelpose"  #: of BVH, GLB and FBX.

    def of(self, motion: Motion) -> Motion:
        """The motion as it is handed on. InputError where no pose is left."""
        first, stop = self.frames or (None, None)
        inside = motion.frames >= (-np.inf if first is None else first)
        inside &= motion.frames < (np.inf if stop is None else stop)
        if self.frames and len(motion) and not inside.any():
            raise InputError(
                f"none of these frames has a pose: they are among {motion.frames[0]} to"
                f" {motion.frames[-1]}"
            )
        motion = motion if inside.all() else motion.select(np.flatnonzero(inside))
        if self.in_place:
            motion = replace(motion, root_m=np.outer(motion.root_m @ motion.up, motion.up))
        return motion if self.rate_hz is None else at_rate(motion, self.rate_hz)

    def facts(self, motion: Motion) -> dict[str, Any]:
        """What was changed, for the record of an export; empty where nothing was."""
        source = motion.sampled_from
        known = {} if source is None else {"sampled_from_hz": source.fps}
        usual = Excerpt()
        given = {name: getattr(self, name) for name in ("skeleton", "in_place")}
        return known | {n: value for n, value in given.items() if value != getattr(usual, n)}


def at_rate(motion: Motion, fps: float) -> Motion:
    """A motion at another frame rate, on the same clock: positions and angles on cubic curves
    through its poses. Where a neighbouring frame has none, there is none either.

    Raises:
        InputError: it has less than two poses, or none at the new frames.
    """
    step = motion.fps / fps
    if len(motion) < 2 or not np.isfinite(step):
        raise InputError("a single pose has no other rate: export it at its own")
    first, last = motion.frames[[0, -1]] / step
    numbers = np.arange(np.ceil(first - 1e-6), last + 1e-6)
    wanted = np.clip((numbers * step).round(6), *motion.frames[[0, -1]])
    lower, upper = np.floor(wanted), np.ceil(wanted)
    posed = np.isin(lower, motion.frames) & np.isin(upper, motion.frames)
    if not posed.any():
        raise InputError(f"no pose is left at {fps:g} frames per second: give more of them")
    wanted, lower, upper = wanted[posed], lower[posed], upper[posed]
    poses = motion.root_m, motion.root_quaternion, motion.angles_rad
    root_m, quaternion, angles = poses_between(motion.frames, poses, wanted, "pchip")
    nearest, before, after = (
        np.searchsorted(motion.frames, frames) for frames in (np.rint(wanted), lower, upper)
    )
    return replace(
        motion,
        fps=float(fps),
        root_m=root_m,
        root_quaternion=quaternion,
        angles_rad=angles,
        frames=numbers[posed].astype(np.int64),
        time_s=np.interp(wanted, motion.frames, motion.time_s),
        filled=motion.filled[before] | motion.filled[after],
        quality={name: values[nearest] for name, values in motion.quality.items()},
        unfiltered=None,
        sampled_from=motion,
    )
