"""Poses over time off line: anchored in clear frames, stepped from there forward and backward, and
smoothed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import pairwise
from threading import Lock

import numpy as np

from silhouette_core.motion.dynamics import FPS, elapsed_steps, neighbour_middle
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.refine import PosePrior
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import (
    PLACEMENTS,
    BodyGeometry,
    PoseFit,
    find_pose,
    refine_fit,
    refinement,
)
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.body_track import RECENT, BodyTrack, process_noise
from voxelpose.multiview.tuning import OFF_LINE, REFINING, TRACKING

_BESIDE = 3  # frames beside a searched one that are not searched as well
_SMOOTH = refinement(REFINING.smooth_reach_m)

Clock = Callable[[str], AbstractContextManager[None]]
"""Times a block under a stage's name."""


class PoseTracker:
    """Poses of a recording's frames, improved step by step; tells every frame."""

    def __init__(
        self,
        body: BodyGeometry,
        observations: ObservationStore,
        fps: float,
        matching: MatchSettings,
        clock: Clock,
        advance: Callable[[], None],
        numbers: np.ndarray | None = None,
    ):
        """Starts without poses; `numbers` (T,) int64, increasing, tell how many frames are between
        those observed, None: none.
        """
        self.body = body
        self.observations = observations
        self.fps, self.matching = fps, matching
        self._steps = np.arange(len(observations)) if numbers is None else numbers - numbers[0]
        self.poses: list[Pose | None] = [None] * len(observations)
        self.error = np.full(len(observations), np.inf)
        self._clock = clock
        self._advance = advance
        self._lock = Lock()

    def observe(self, t: int) -> FrameObservation | None:
        """One frame's observation, near the body's position in that frame or a neighbouring one."""
        near = next(
            (
                pose.root_m
                for k in (t, t - 1, t + 1)
                if 0 <= k < len(self.poses) and (pose := self.poses[k]) is not None
            ),
            None,
        )
        return self.observations.observe(t, near)

    def begin(self, poses: dict[int, Pose], errors: dict[int, float]) -> None:
        """Tracks from frames fitted on their own to their neighbours, smallest error first."""
        for t, pose in poses.items():
            self._keep(t, PoseFit(pose, errors[t]))
        for t in sorted(poses, key=lambda k: errors[k]):
            self.carry(t)

    def anchor(self, t: int, count: int = PLACEMENTS) -> bool:
        """Searches one frame without a prior, `count` torsos; whether that gave a better pose."""
        frame = self.observe(t)
        if frame is None:
            return False
        fits = find_pose(self.body, frame, self.matching, count)
        if not fits or fits[0].error > min(TRACKING.lost, TRACKING.better * self.error[t]):
            return False
        self._keep(t, fits[0])
        return True

    def carry(self, start: int) -> None:
        """Tracks from a posed frame both ways at once, while poses improve."""
        ways = [(self._track_at(start, direction), direction) for direction in (+1, -1)]
        side_by_side(lambda way: self._carry(*way), ways)

    def _carry(self, track: BodyTrack | None, direction: int) -> None:
        """Tracks one way."""
        while track is not None:
            t = int(np.searchsorted(self._steps, round(track.time_s * self.fps))) + direction
            track = self._step(track, t)
            if track is None or track.fit.error >= TRACKING.better * self.error[t]:
                return
            self._keep(t, track.fit)
            with self._lock:
                self._advance()

    def _track_at(self, t: int, direction: int) -> BodyTrack | None:
        """Track that has come to a frame from the ones before it, or after it."""
        pose = self.poses[t]
        if pose is None:
            return None
        past = [
            k
            for k in range(t, t - RECENT * direction, -direction)
            if 0 <= k < len(self.poses) and np.isfinite(self.error[k])
        ]
        before = None
        if t - direction in past and (last := self.poses[t - direction]) is not None:
            before = self._time_s(t - direction), last
        errors = tuple(float(self.error[k]) for k in reversed(past))
        fit = PoseFit(pose, float(self.error[t]))
        return BodyTrack(self.body, self._time_s(t), fit, before, errors)

    def _step(self, track: BodyTrack, t: int) -> BodyTrack | None:
        """Track with one more frame, its limbs searched if poor; None where no pose fits."""
        if not 0 <= t < len(self.poses):
            return None
        frame = self.observations.observe(t, track.fit.pose.root_m)
        if frame is None:
            return None
        with self._clock("pose"):
            stepped = track.step(frame.observation, self._time_s(t))
            if track.is_poor(stepped.fit.error):
                stepped = stepped.with_limbs(frame.observation)
        return stepped if stepped.fit.error < TRACKING.lost else None

    def repair(self, most: int) -> None:
        """Searches at most `most` of the worst frames again, and tracks from those that improve."""
        tried = ~self.observations.there
        for _ in range(most):
            errors = np.minimum(self.error, TRACKING.lost)
            bad = np.where(tried, -np.inf, errors)
            t = int(bad.argmax())
            if bad[t] < TRACKING.bad * np.median(errors):
                return
            tried[max(t - _BESIDE, 0) : t + _BESIDE + 1] = True
            if self.anchor(t):
                self.carry(t)

    def mend_jumps(self) -> None:
        """Tracks again across the jumps between frames, from the longest stretch without one.

        A stretch that was begun elsewhere, turned half round or with a leg in the other's place, is
        replaced where tracking on from its neighbour explains the silhouettes about as well.
        """
        bounds = [0, *(self._jumps() + 1).tolist(), len(self.poses)]
        if len(bounds) < 3:
            return
        stretches = list(pairwise(bounds))
        longest = max(range(len(stretches)), key=lambda k: stretches[k][1] - stretches[k][0])
        for stretch in stretches[longest + 1 :]:
            self._continue(range(*stretch), +1)
        for first, end in reversed(stretches[:longest]):
            self._continue(range(end - 1, first - 1, -1), -1)

    def _continue(self, frames: range, direction: int) -> None:
        """Tracks on into some frames, unless they explain the silhouettes clearly better now."""
        track, fits = self._track_at(frames[0] - direction, direction), {}
        for t in frames:
            track = track and self._step(track, t)
            if track is None:
                return
            fits[t] = track.fit
        short = len(fits) <= OFF_LINE.short_s * self.fps
        most = OFF_LINE.continued_short if short else OFF_LINE.continued
        if np.mean([fit.error for fit in fits.values()]) < most * self.error[list(fits)].mean():
            for t, fit in fits.items():
                self._keep(t, fit)

    def joints_m(self) -> np.ndarray:
        """Joints (T, L, 3) of all frames, metres; NaN without a pose."""
        joints = np.full((len(self.poses), *self.body.model.landmarks_m.shape), np.nan)
        posed = {t: pose for t, pose in enumerate(self.poses) if pose is not None}
        joints[[*posed]] = joints_of(self.body.model, [*posed.values()])
        return joints

    def _jumps(self) -> np.ndarray:
        """Frames after which the pose jumps: farther than people move, and than around it."""
        joints = self.joints_m()
        steps = np.linalg.norm(np.diff(joints - joints[:, :1], axis=0), axis=2).mean(axis=1)
        steps = steps / np.diff(self._steps)
        both = np.flatnonzero(np.isfinite(steps))
        half = RECENT // 2
        around = [np.nanmedian(steps[max(t - half, 0) : t + half + 1]) for t in both]
        farthest = OFF_LINE.jump_m * FPS / self.fps
        return both[steps[both] > np.maximum(farthest, OFF_LINE.jump_ratio * np.array(around))]

    def recheck(self) -> None:
        """Searches every arm and leg again in some frames, evenly spread.

        A limb that is wrong in all frames of a stretch shows no rise of the error. Where the limb
        explains the silhouettes better, its neighbours are tracked from there.
        """
        stride = max(round(self.fps * OFF_LINE.limbs_again_s), 1)
        chosen = list(range(stride // 2, len(self.poses), stride))
        poses = list(self.poses)
        searched = dict(zip(chosen, side_by_side(self._searched, chosen), strict=True))
        for t in chosen:
            # What was tracked here in the meantime is searched again.
            moved = searched[t] if self.poses[t] is poses[t] else self._searched(t)
            if moved is not None and moved.error < self.error[t]:
                self._keep(t, moved)
                self.carry(t)

    def _searched(self, t: int) -> PoseFit | None:
        """A frame's pose with every arm and leg searched again."""
        with self._lock:
            self._advance()
        track = self._track_at(t, +1)
        if track is None or (frame := self.observe(t)) is None:
            return None
        with self._clock("recheck"):
            return track.with_limbs(frame.observation).fit

    def polish(self) -> None:
        """Refines every pose again, with the middle of its neighbours as prior."""
        old, frames = list(self.poses), range(len(self.poses))

        def smoothed(t: int) -> PoseFit | None:
            with self._lock:
                self._advance()
            pose = old[t]
            if pose is None or (frame := self.observe(t)) is None:
                return None
            with self._clock("refinement"):
                steps = self._steps_around(t)
                before, after = (old[t - 1], old[t + 1]) if steps else (None, None)
                passed = elapsed_steps(0.0, (steps or 1) / self.fps)
                sigma = process_noise(self.body.model.tree, passed)
                prior = PosePrior(neighbour_middle(before, pose, after), sigma)
                return refine_fit(self.body, frame.observation, pose, prior, _SMOOTH)

        for t, fit in zip(frames, side_by_side(smoothed, frames), strict=True):
            if fit is not None:
                self._keep(t, fit)

    def _keep(self, t: int, fit: PoseFit) -> None:
        self.poses[t], self.error[t] = fit.pose, fit.error

    def _steps_around(self, t: int) -> int:
        """How many frames before and after a frame its neighbours are; 0 where that differs."""
        near = np.diff(self._steps[max(t - 1, 0) : t + 2])
        return int(near[0]) if len(near) == 2 and near[0] == near[1] else 0

    def _time_s(self, t: int) -> float:
        return float(self._steps[t]) / self.fps
