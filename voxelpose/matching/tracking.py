"""Poses over time: anchored where a frame is clear by itself, and carried from there both ways."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import numpy as np

from silhouette_core.refinement.pose import ROOT_STEP_SIGMA, STEP_SIGMA_RAD, Pose
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.silhouette_error import silhouette_error
from voxelpose.matching.mask_store import MaskStore
from voxelpose.matching.matcher import MatchSettings, match
from voxelpose.matching.observe import FrameObservation, HullObserver
from voxelpose.matching.pose_search import FittingBody, PoseFit, find_pose, move_limbs

_FOLLOW = RefineSettings(reaches_m=(0.20, 0.15, 0.12, 0.09, 0.07, 0.06, 0.06))
_POLISH = RefineSettings(reaches_m=(0.08, 0.06, 0.05, 0.05))
_MOMENTUM = 0.8  # share of the last step that the next one is expected to repeat
_NEARBY = MatchSettings(step_rad=np.radians(14.0), around_rad=np.radians(42.0))
_BETTER = 0.97  # an answer replaces another where its error is below this share of the other's
_POOR, _POOR_BY = (
    1.2,
    0.01,
)  # a frame is poor where its error exceeds the usual by this factor and this much
_RECHECK_S = 0.25
_LOST = 0.45  # a pose that leaves so much of the silhouettes unexplained is no answer


Clock = Callable[[str], AbstractContextManager[None]]
"""Times a block under a stage's name."""


@dataclass(frozen=True)
class PoseTrackerSettings:
    """How poses are carried from frame to frame.

    Attributes:
        fps: frames per second; what a joint turns in a frame shrinks with it.
        match: settings of the matcher for a search over the whole range.
    """

    fps: float
    match: MatchSettings


class PoseTracker:
    """The poses found so far.

    Args:
        body: the fitted body.
        observer: turns raw silhouettes into sights.
        store: the raw silhouettes.
        settings: see PoseTrackerSettings.
        clock: times every step.
        advance: called once for every frame whose pose was worked on.
    """

    def __init__(
        self,
        body: FittingBody,
        observer: HullObserver,
        store: MaskStore,
        settings: PoseTrackerSettings,
        clock: Clock,
        advance: Callable[[], None],
    ):
        """Starts with no pose."""
        self.body = body
        self.observer = observer
        self.store = store
        self.settings = settings
        self.poses: list[Pose | None] = [None] * len(store)
        self.error = np.full(len(store), np.inf)
        self._clock = clock
        self._advance = advance
        self._pace = float(np.clip(30.0 / settings.fps, 0.3, 3.0))

    def observed(self, t: int) -> FrameObservation | None:
        """Looks at one frame, near where the body was in its neighbours."""
        near = next(
            (
                pose.root_m
                for k in (t, t - 1, t + 1)
                if 0 <= k < len(self.poses) and (pose := self.poses[k]) is not None
            ),
            None,
        )
        return self.observer.look(self.store[t], near)

    def begin(self, poses: dict[int, Pose], errors: dict[int, float]) -> None:
        """Takes poses found by themselves, and carries each to its neighbours, the surest first."""
        for t, pose in poses.items():
            self.poses[t], self.error[t] = pose, errors[t]
        for t in sorted(poses, key=lambda k: errors[k]):
            self.carry(t, +1)
            self.carry(t, -1)

    def anchor(self, t: int, count: int = 10) -> bool:
        """Searches one frame from nothing; says whether that gave a better pose than the one it
        had.
        """
        observed = self.observed(t)
        if observed is None:
            return False
        found = find_pose(
            self.body,
            observed.observation,
            observed.grid,
            observed.occupancy,
            self.settings.match,
            count,
        )
        if not found or found[0].error > min(_LOST, _BETTER * self.error[t]):
            return False
        self.poses[t], self.error[t] = found[0].pose, found[0].error
        return True

    def carry(self, start: int, direction: int) -> None:
        """Follows the body from a posed frame forward (+1) or backward (-1), as long as the answers
        are better than those it has.
        """
        t = start + direction
        while 0 <= t < len(self.poses):
            with self._clock("pose"):
                pose, error = self._follow(t, direction)
            if pose is None or error >= _BETTER * self.error[t]:
                return
            self.poses[t], self.error[t] = pose, error
            self._advance()
            t += direction

    def repair(self, most: int) -> None:
        """Searches the worst frames from nothing, and carries what is better to their neighbours."""
        tried = np.zeros(len(self.poses), bool)
        for _ in range(most):
            usual = float(np.median(np.minimum(self.error, _LOST)))
            bad = np.where(tried, -np.inf, np.where(np.isfinite(self.error), self.error, _LOST))
            t = int(bad.argmax())
            if bad[t] < 1.3 * usual:
                return
            tried[max(t - 3, 0) : t + 4] = True
            if self.anchor(t):
                self.carry(t, +1)
                self.carry(t, -1)

    def recheck(self) -> None:
        """Looks for every arm and leg anew in some frames, a quarter of a second apart: one gone
        astray with its neighbours shows no rise.

        What explains the silhouettes better is carried to the neighbours.
        """
        stride = max(round(self.settings.fps * _RECHECK_S), 1)
        for t in range(stride // 2, len(self.poses), stride):
            self._advance()
            pose = self.poses[t]
            if pose is None or (observed := self.observed(t)) is None:
                continue
            with self._clock("recheck"):
                found = move_limbs(self.body, observed.observation, PoseFit(pose, self.error[t]))
            if found.error < _BETTER * self.error[t]:
                self.poses[t], self.error[t] = found.pose, found.error
                self.carry(t, +1)
                self.carry(t, -1)

    def polish(self) -> None:
        """Refines every pose once more, drawn toward the middle of its neighbours: the future is
        known now.
        """
        old = list(self.poses)
        sigma = np.concatenate([ROOT_STEP_SIGMA, STEP_SIGMA_RAD]) * self._pace
        for t, pose in enumerate(old):
            self._advance()
            if pose is None or (observed := self.observed(t)) is None:
                continue
            with self._clock("refinement"):
                before, after = (old[k] if 0 <= k < len(old) else None for k in (t - 1, t + 1))
                middle = (
                    pose
                    if before is None or after is None
                    else before.moved(0.5 * after.minus(before))
                )
                refined = refine(
                    self.body.surface, observed.observation, pose, PosePrior(middle, sigma), _POLISH
                ).pose
                self.poses[t] = refined
                self.error[t] = silhouette_error(self.body.model, refined, observed.observation)

    def _follow(self, t: int, direction: int) -> tuple[Pose | None, float]:
        last = self.poses[t - direction]
        observed = self.observed(t)
        if observed is None or last is None:
            return None, np.inf
        expected = self._predict(t, direction, last)
        sigma = np.concatenate([ROOT_STEP_SIGMA, STEP_SIGMA_RAD]) * self._pace
        pose = refine(
            self.body.surface, observed.observation, expected, PosePrior(expected, sigma), _FOLLOW
        ).pose
        error = silhouette_error(self.body.model, pose, observed.observation)
        usual = self._usual(t, direction)
        if error > _POOR * usual + _POOR_BY:
            pose, error = self._search_near(
                observed, expected, PosePrior(expected, 2 * sigma), pose, error
            )
        if error > _POOR * usual + _POOR_BY:
            moved = move_limbs(
                self.body,
                observed.observation,
                PoseFit(pose, error),
                PosePrior(expected, 6 * sigma),
            )
            pose, error = moved.pose, moved.error
        return (pose, error) if error < _LOST else (None, np.inf)

    def _search_near(
        self, observed: FrameObservation, expected: Pose, prior: PosePrior, pose: Pose, error: float
    ) -> tuple[Pose, float]:
        """Matches voxels around the expected pose, and around the refined one, whose torso is
        better placed.
        """
        near = replace(_NEARBY, interference=self.settings.match.interference)
        for start in (pose, Pose(pose.root_m, pose.root_rotation, expected.angles_rad)):
            matched = match(
                self.body.body_volume, observed.grid, observed.occupancy, start, near
            ).pose
            other = refine(self.body.surface, observed.observation, matched, prior, _FOLLOW).pose
            other_error = silhouette_error(self.body.model, other, observed.observation)
            if other_error < _BETTER * error:
                pose, error = other, other_error
        return pose, error

    def _predict(self, t: int, direction: int, last: Pose) -> Pose:
        before = self.poses[t - 2 * direction] if 0 <= t - 2 * direction < len(self.poses) else None
        return last if before is None else last.moved(_MOMENTUM * last.minus(before)).clipped()

    def _usual(self, t: int, direction: int) -> float:
        past = self.error[max(t - 12, 0) : t] if direction > 0 else self.error[t + 1 : t + 13]
        past = past[np.isfinite(past)]
        return float(np.median(past)) if len(past) else np.inf
