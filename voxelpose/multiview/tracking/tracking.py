"""Poses over time: anchored in clear frames, tracked from there forward and backward."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from itertools import pairwise
from threading import Lock

import numpy as np

from silhouette_core.motion.dynamics import FPS, neighbour_middle, pose_step_sigma, predict
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.refine import PosePrior, RefineSettings
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings, match
from voxelpose.multiview.matching.pose_search import (
    BodyGeometry,
    PoseFit,
    find_pose,
    move_limbs,
    refine_fit,
)
from voxelpose.multiview.silhouettes.observation_store import ObservationStore

_FOLLOW = RefineSettings(reaches_m=(0.20, 0.15, 0.12, 0.09, 0.07, 0.06, 0.06))
_POLISH = RefineSettings(reaches_m=(0.08, 0.06, 0.05, 0.05))
_NEARBY = MatchSettings(step_rad=np.radians(14.0), around_rad=np.radians(42.0))
_BETTER = 0.97  # a pose replaces another where its error is below this fraction of the other's
_POOR, _POOR_BY = 1.2, 0.01  # factor, and excess, over the recent error that make a frame poor
_AGAIN = 0.12  # median error from which a recording is begun again; right ones have 0.06 to 0.1
_AGAIN_FRAMES, _AGAIN_PLACEMENTS = 9, 20
_JUMP_M, _JUMP_RATIO = 0.10, 3.0  # mean step of the joints at 30 frames per second, to be a jump
# Of its error, up to which a stretch is replaced by one that continues: long, short.
_CONTINUED, _CONTINUED_SHORT, _SHORT_S = 1.1, 1.5, 0.25
_RECHECK_S = 0.25
_LOST = 0.45  # largest error of a pose that is kept

Clock = Callable[[str], AbstractContextManager[None]]
"""Times a block under a stage's name."""


@dataclass(frozen=True)
class PoseTrackerSettings:
    """How poses are propagated from frame to frame.

    Attributes:
        fps: frames per second; the expected step of a joint shrinks with it.
        match: settings of the matcher for a search over the whole range.
    """

    fps: float
    match: MatchSettings


class PoseTracker:
    """Poses of a recording's frames, improved step by step.

    Args:
        body: the body that is fitted.
        observations: of every frame.
        settings: see PoseTrackerSettings.
        clock: times every step.
        advance: called once for every frame whose pose was worked on.
    """

    def __init__(
        self,
        body: BodyGeometry,
        observations: ObservationStore,
        settings: PoseTrackerSettings,
        clock: Clock,
        advance: Callable[[], None],
    ):
        """Starts without poses."""
        self.body = body
        self.observations = observations
        self.settings = settings
        self.poses: list[Pose | None] = [None] * len(observations)
        self.error = np.full(len(observations), np.inf)
        self._clock = clock
        self._advance = advance
        self._lock = Lock()
        self._sigma = pose_step_sigma(body.model.tree) * float(
            np.clip(FPS / settings.fps, 0.3, 3.0)
        )

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
        """Tracks from frames fitted on their own to their neighbours, smallest error first.

        Args:
            poses: frame -> pose.
            errors: frame -> its silhouette error.
        """
        for t, pose in poses.items():
            self.poses[t], self.error[t] = pose, errors[t]
        for t in sorted(poses, key=lambda k: errors[k]):
            self.carry(t)

    def anchor(self, t: int, count: int = 10) -> bool:
        """Searches one frame without a prior; whether that gave a better pose than before.

        Args:
            t: the frame.
            count: torso placements to try.
        """
        frame = self.observe(t)
        if frame is None:
            return False
        fits = find_pose(self.body, frame, self.settings.match, count)
        if not fits or fits[0].error > min(_LOST, _BETTER * self.error[t]):
            return False
        self._keep(t, fits[0])
        return True

    def carry(self, start: int) -> None:
        """Tracks the body from a posed frame forward and backward, while poses improve.

        Both ways at once: neither sees what the other changes.
        """
        poses, error = list(self.poses), self.error.copy()
        side_by_side(
            lambda direction: self._carry(start, direction, poses.copy(), error.copy()), (+1, -1)
        )

    def _carry(
        self, start: int, direction: int, poses: list[Pose | None], error: np.ndarray
    ) -> None:
        """Tracks one way; `poses` and `error`, by frame, are those when it began."""
        t = start + direction
        while 0 <= t < len(self.poses):
            ahead = slice(start, None) if direction > 0 else slice(None, start + 1)
            poses[ahead], error[ahead] = self.poses[ahead], self.error[ahead]
            with self._clock("pose"):
                fit = self._follow(t, direction, poses, error)
            if fit is None or fit.error >= _BETTER * self.error[t]:
                return
            self._keep(t, fit)
            with self._lock:
                self._advance()
            t += direction

    def begin_again(self) -> None:
        """Searches other frames without a prior where all poses are worse than they should be, and
        tracks from those that improve.

        What the first poses have in common, like a head in the place of an arm, is carried through
        the whole recording and shows as no rise of the error.
        """
        if np.median(np.minimum(self.error, _LOST)) < _AGAIN:
            return
        last = len(self.poses) - 1
        for t in np.unique(np.linspace(0, last, min(_AGAIN_FRAMES, last + 1)).astype(int)):
            if self.anchor(int(t), _AGAIN_PLACEMENTS):
                self.carry(int(t))

    def repair(self, most: int) -> None:
        """Searches at most `most` of the worst frames again, and tracks from those that improve."""
        tried = np.zeros(len(self.poses), bool)
        for _ in range(most):
            usual = float(np.median(np.minimum(self.error, _LOST)))
            bad = np.where(tried, -np.inf, np.where(np.isfinite(self.error), self.error, _LOST))
            t = int(bad.argmax())
            if bad[t] < 1.3 * usual:
                return
            tried[max(t - 3, 0) : t + 4] = True
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
        """Tracks on into some frames, unless they explain the silhouettes clearly better as they
        are.
        """
        poses, error = list(self.poses), self.error.copy()
        for t in frames:
            with self._clock("pose"):
                fit = self._follow(t, direction, poses, error)
            if fit is None:
                return
            poses[t], error[t] = fit.pose, fit.error
        chosen = list(frames)
        short = len(chosen) <= _SHORT_S * self.settings.fps
        most = _CONTINUED_SHORT if short else _CONTINUED
        if error[chosen].mean() < most * self.error[chosen].mean():
            for t in chosen:
                self.poses[t], self.error[t] = poses[t], error[t]

    def _jumps(self) -> np.ndarray:
        """Frames after which the pose jumps: farther than people move, and than around it."""
        posed = [pose is not None for pose in self.poses]
        both = np.flatnonzero(np.logical_and(posed[1:], posed[:-1]))
        if not len(both):
            return both
        poses = PoseArrays.from_poses([pose for pose in self.poses if pose is not None])
        joints = landmarks(self.body.model, *place(self.body.model, *poses.arrays))
        index = np.cumsum(posed) - 1
        joints = joints - joints[:, :1]
        steps = np.full(len(self.poses) - 1, np.nan)
        steps[both] = np.linalg.norm(joints[index[both + 1]] - joints[index[both]], axis=2).mean(1)
        around = [np.nanmedian(steps[max(t - 6, 0) : t + 7]) for t in both]
        farthest = _JUMP_M * FPS / self.settings.fps
        return both[steps[both] > np.maximum(farthest, _JUMP_RATIO * np.array(around))]

    def recheck(self) -> None:
        """Searches every arm and leg again in some frames, a quarter of a second apart.

        A limb that is wrong in all frames of a stretch shows no rise of the error. Where the limb
        explains the silhouettes better, its neighbours are tracked from there.
        """
        stride = max(round(self.settings.fps * _RECHECK_S), 1)
        chosen = [t for t in range(stride // 2, len(self.poses), stride)]
        poses = list(self.poses)
        searched = dict(zip(chosen, side_by_side(self._searched, chosen), strict=True))
        for t in chosen:
            # What was tracked here in the meantime is searched again.
            moved = searched[t] if self.poses[t] is poses[t] else self._searched(t)
            if moved is not None and moved.error < _BETTER * self.error[t]:
                self._keep(t, moved)
                self.carry(t)

    def _searched(self, t: int) -> PoseFit | None:
        """A frame's pose with every arm and leg searched again."""
        with self._lock:
            self._advance()
        pose = self.poses[t]
        if pose is None or (frame := self.observe(t)) is None:
            return None
        with self._clock("recheck"):
            return move_limbs(self.body, frame.observation, PoseFit(pose, self.error[t]))

    def polish(self) -> None:
        """Refines every pose again, with the middle of its neighbours as prior."""
        old, frames = list(self.poses), range(len(self.poses))

        def polished(t: int) -> PoseFit | None:
            with self._lock:
                self._advance()
            pose = old[t]
            if pose is None or (frame := self.observe(t)) is None:
                return None
            with self._clock("refinement"):
                before, after = (old[k] if 0 <= k < len(old) else None for k in (t - 1, t + 1))
                prior = PosePrior(neighbour_middle(before, pose, after), self._sigma)
                return refine_fit(self.body, frame.observation, pose, prior, _POLISH)

        for t, fit in zip(frames, side_by_side(polished, frames), strict=True):
            if fit is not None:
                self._keep(t, fit)

    def _keep(self, t: int, fit: PoseFit) -> None:
        self.poses[t], self.error[t] = fit.pose, fit.error

    def _follow(
        self, t: int, direction: int, poses: list[Pose | None], error: np.ndarray
    ) -> PoseFit | None:
        """Tracks from the neighbouring frame; None where no pose explains the silhouettes."""
        last, t_before = poses[t - direction], t - 2 * direction
        frame = self.observe(t)
        if frame is None or last is None:
            return None
        before = poses[t_before] if 0 <= t_before < len(poses) else None
        predicted = predict(last, before, self.body.model.dof_limits_rad)
        prior = PosePrior(predicted, self._sigma)
        fit = refine_fit(self.body, frame.observation, predicted, prior, _FOLLOW)
        poor = _POOR * _usual(error, t, direction) + _POOR_BY
        if fit.error > poor:
            fit = self._search_near(frame, predicted, fit)
        if fit.error > poor:
            prior = PosePrior(predicted, 6 * self._sigma)
            fit = move_limbs(self.body, frame.observation, fit, prior)
        return fit if fit.error < _LOST else None

    def _search_near(self, frame: FrameObservation, predicted: Pose, fit: PoseFit) -> PoseFit:
        """Matches voxels around the refined pose, and around the predicted angles on its torso."""
        near = replace(_NEARBY, interference=self.settings.match.interference)
        prior = PosePrior(predicted, 2 * self._sigma)
        volume, root = self.body.body_volume, fit.pose
        for angles in (root.angles_rad, predicted.angles_rad):
            start = Pose(root.root_m, root.root_rotation, angles)
            matched = match(volume, frame.grid, frame.occupancy, start, near).pose
            other = refine_fit(self.body, frame.observation, matched, prior, _FOLLOW)
            if other.error < _BETTER * fit.error:
                fit = other
        return fit


def _usual(error: np.ndarray, t: int, direction: int) -> float:
    """Median error of the twelve frames tracked before frame t."""
    past = error[max(t - 12, 0) : t] if direction > 0 else error[t + 1 : t + 13]
    past = past[np.isfinite(past)]
    return float(np.median(past)) if len(past) else np.inf
