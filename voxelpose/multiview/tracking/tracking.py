"""Poses over time off line: candidates of every frame, the cheapest trajectory through them, and
its joint fit.

A pose that was searched in one frame is followed from there both ways: what it becomes in each is a
candidate, beside those that others become. So which limb was wrong for a while, which leg crossed,
or who was turned round, is decided by the cost of the whole trajectory.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from threading import Lock

import numpy as np

from calib.checks import FloatArray
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.kinematics import centres_of, joints_of
from silhouette_core.motion.pose import JointTarget, Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.landmark_prior import target_costs
from silhouette_core.refinement.observation import Observation
from silhouette_core.scoring.silhouette_error import silhouette_error
from silhouette_core.tracking.beam import Beam, backtrack
from silhouette_core.tracking.step_costs import StepCosts
from silhouette_core.tracking.trajectory_fit import FrameEvidence, fit_trajectory
from silhouette_core.tuning import STEPS
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person.posterior import is_improbable, is_unusual
from voxelpose.multiview.proposers.pose_search import BodyGeometry, PoseFit, find_pose, move_limbs
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.body_track import BodyTrack, is_near
from voxelpose.multiview.tuning import OFF_LINE, TRACKING

_BESIDE = 3  # frames beside a searched one that are not searched as well
_ROUNDS = 3  # of the fit of one frame to joints that were set
_BLOCK, _AHEAD = 24, 8  # frames fitted together, and frames that must follow them

Clock = Callable[[str], AbstractContextManager[None]]
"""Times a block under a stage's name."""


class PoseTracker:
    """Candidates for the poses of a recording's frames, and the cheapest trajectory through them.

    Attributes:
        poses: of all frames, along that trajectory; None: no pose explains the silhouettes.
        error: (T,) float64, their silhouette errors; infinite without a pose.
    """

    def __init__(
        self,
        body: BodyGeometry,
        observations: ObservationStore,
        fps: float,
        matching: MatchSettings,
        clock: Clock,
        advance: Callable[[], None],
        numbers: np.ndarray | None = None,
        targets: Sequence[JointTarget] = (),
    ):
        """Starts without poses; `numbers` (T,) int64, increasing, of the frames observed, tell how
        many are between them, None: none. `targets`: joints that were set, in the upright frame.
        """
        self.body = body
        self.observations = observations
        self.fps, self.matching = fps, matching
        steps = np.arange(len(observations)) if numbers is None else numbers - numbers[0]
        self._times_s = steps / fps
        rows = {} if numbers is None else {number: t for t, number in enumerate(numbers.tolist())}
        self._targets: dict[int, list[JointTarget]] = {}
        for target in targets:
            if target.frame in rows:
                self._targets.setdefault(rows[target.frame], []).append(target)
        self.poses: list[Pose | None] = [None] * len(observations)
        self.error = np.full(len(observations), np.inf)
        self._candidates: list[list[PoseFit]] = [[] for _ in self.poses]
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

    def follow(self, fits: Iterable[tuple[int, PoseFit]]) -> None:
        """Follows poses of some frames, by number, both ways, the likeliest first, and decides."""
        ranked = sorted(fits, key=lambda one: (one[1].error, one[0]))
        for t, fit in [one for one in ranked if self._is_new(*one)]:
            side_by_side(lambda way, t=t, fit=fit: self._carry(t, fit, way), (+1, -1))
        self._decide()

    def search(self, frames: Sequence[int]) -> None:
        """Searches some frames without a prior, and follows the best pose of each."""

        def searched(t: int) -> list[PoseFit]:
            frame = self.observe(t)
            return [] if frame is None else find_pose(self.body, frame, self.matching)[:1]

        results = zip(frames, side_by_side(searched, frames), strict=True)
        self.follow((t, fit) for t, fits in results for fit in fits)

    def search_worst(self, most: int) -> None:
        """Searches at most `most` frames without a prior, from the worst on, while one is worse
        than usual or all are improbable.

        What all first poses have in common, like a head in the place of an arm, shows as no rise of
        the error.
        """
        tried = ~self.observations.there
        for _ in range(most):
            errors = np.minimum(self.error, TRACKING.lost)
            t = int(np.where(tried, -np.inf, errors).argmax())
            if tried[t]:
                return
            usual = float(np.median(errors[self.observations.there]))
            if not is_unusual(errors[t], usual) and not is_improbable(errors[~tried]):
                return
            tried[max(t - _BESIDE, 0) : t + _BESIDE + 1] = True
            self.search([t])

    def search_limbs(self) -> None:
        """Searches every arm and leg in some frames, evenly spread, and follows what fits better.

        A limb that is wrong in all frames of a stretch shows no rise of the error.
        """
        stride = max(round(self.fps * OFF_LINE.limbs_again_s), 1)
        chosen = range(stride // 2, len(self.poses), stride)

        def searched(t: int) -> PoseFit | None:
            with self._lock:
                self._advance()
            pose, frame = self.poses[t], self.observe(t)
            if pose is None or frame is None:
                return None
            with self._clock("recheck"):
                return move_limbs(self.body, frame.observation, PoseFit(pose, float(self.error[t])))

        results = zip(chosen, side_by_side(searched, chosen), strict=True)
        self.follow((t, fit) for t, fit in results if fit is not None and fit.error < self.error[t])

    def reach_targets(self) -> None:
        """Follows, from each frame in which joints were set, the pose that has them there."""
        fits = []
        for t, targets in self._targets.items():
            pose, frame = self.poses[t], self.observe(t)
            if pose is None or frame is None:
                continue
            evidence = FrameEvidence(frame.observation, 0.0, targets=targets)
            for _ in range(_ROUNDS):
                (pose,) = fit_trajectory(self.body.surface, [evidence], [pose], floor=False)
            fits.append((t, PoseFit(pose, self._silhouette_error(pose, frame.observation))))
        if fits:
            self.follow(fits)

    def _silhouette_error(self, pose: Pose, observation: Observation) -> float:
        backend = self.body.body_volume.backend
        return silhouette_error(self.body.model, pose, observation, backend)

    def smooth(self) -> None:
        """Refines the poses of all frames together, in blocks, so that memory does not grow."""
        posed = [t for t, pose in enumerate(self.poses) if pose is not None]
        usual = max(float(np.median(self.error[posed])), 1e-6) if posed else 1.0
        for first in range(0, len(posed), _BLOCK):
            self._smooth(posed[max(first - 2, 0) : first + _BLOCK + _AHEAD], min(first, 2), usual)

    def _smooth(self, frames: Sequence[int], decided: int, usual: float) -> None:
        """Refines a block of frames, of which the first are decided and the last look ahead."""
        before, frames = frames[:decided], frames[decided:]
        if before and self._times_s[frames[0]] - self._times_s[before[0]] > 3 / self.fps:
            before = []  # somebody was away
        seen = side_by_side(self.observe, frames)
        pairs = [(t, one.observation) for t, one in zip(frames, seen, strict=True) if one]
        # In a frame that explains less than usual the silhouettes are wrong, and count for less.
        evidence = [
            FrameEvidence(
                one,
                float(self._times_s[t]),
                scale=max(self.error[t] / usual, 1.0),
                targets=self._targets.get(t, ()),
            )
            for t, one in pairs
        ]
        with self._clock("refinement"):
            poses = fit_trajectory(
                self.body.surface,
                evidence,
                [pose for t, _ in pairs if (pose := self.poses[t]) is not None],
                floor=False,
                before=[pose for t in before if (pose := self.poses[t]) is not None],
            )
        for (t, one), pose in zip(pairs[:_BLOCK], poses, strict=False):
            error = self._silhouette_error(pose, one)
            self.poses[t], self.error[t] = pose, error
            self._candidates[t] = [PoseFit(pose, error)]
            self._advance()

    def _carry(self, t: int, fit: PoseFit, direction: int) -> None:
        """Follows a pose one way, until another is the same or the cheapest trajectory cannot lead
        through it.
        """
        track: BodyTrack | None = BodyTrack(
            self.body, float(self._times_s[t]), fit, errors=(fit.error,)
        )
        excess = self._excess(t, fit)
        while excess < 2 * STEPS.restart:  # there and back
            t, track = self._step(t, track, direction)
            if track is None:
                return
            excess += self._excess(t, track.fit)
            if not self._is_new(t, track.fit):
                return
            with self._lock:
                self._advance()

    def _step(self, t: int, track: BodyTrack, direction: int) -> tuple[int, BodyTrack | None]:
        """The next frame that the track explains, and the track with it, its limbs searched if
        poor; None where no frame is near enough.
        """
        while 0 <= (t := t + direction) < len(self.poses):
            time_s = float(self._times_s[t])
            if not is_near(track.time_s, time_s):
                break
            frame = self.observations.observe(t, track.fit.pose.root_m)
            if frame is None:
                continue
            with self._clock("pose"):
                stepped = track.step(frame.observation, time_s)
                if track.is_poor(stepped.fit.error):
                    stepped = stepped.with_limbs(frame.observation)
            if stepped.fit.error < TRACKING.lost:
                return t, stepped
        return t, None

    def _excess(self, t: int, fit: PoseFit) -> float:
        """What a pose costs more than the best candidate of its frame, nats; 0 for a first one."""
        *others, cost = self._frame_costs(t, [*self._candidates[t], fit])
        return float(max(cost - min(others, default=cost), 0.0))

    def _frame_costs(self, t: int, fits: Sequence[PoseFit]) -> FloatArray:
        """Costs (K,) of poses of a frame by their silhouette errors, nats, up to a constant; see
        `posterior`; and by how far joints are from where somebody set them.
        """
        errors = np.maximum([fit.error for fit in fits], 1e-6)
        costs = OFF_LINE.frame_residuals * np.log(errors)
        if t in self._targets:
            centres_m = centres_of(self.body.model, [fit.pose for fit in fits])
            costs += target_costs(self.body.model, centres_m, self._targets[t])
        return costs

    def _is_new(self, t: int, fit: PoseFit) -> bool:
        """Adds a candidate, the better of those that are the same pose; whether none was about as
        good.
        """
        fits = self._candidates[t]
        joints = joints_of(self.body.model, [fit.pose, *(one.pose for one in fits)])
        apart = np.linalg.norm(joints[1:] - joints[0], axis=2).max(axis=1)
        same = [one for one, far_m in zip(fits, apart, strict=True) if far_m < OFF_LINE.same_m]
        best = min((one.error for one in same), default=np.inf)
        if fit.error >= min(best, TRACKING.lost):
            return False
        self._candidates[t] = [one for one in fits if one not in same] + [fit]
        return not same

    def _decide(self) -> None:
        """Takes the cheapest trajectory through the candidates."""
        tree = self.body.model.tree
        costs = StepCosts(tree, pose_step_sigma(tree)[6:])
        frames = [t for t, fits in enumerate(self._candidates) if fits]
        beams: list[Beam] = []
        for beam in map(self._beam, frames):
            if beams:
                expected = costs.expected(beams[-1], beams[-2] if len(beams) > 1 else None)
                beam = costs.continued(beam, beams[-1], expected)
            beams.append(beam)
        self.poses = [None] * len(self.poses)
        self.error[:] = np.inf
        for t, k in zip(frames, backtrack(beams) if beams else [], strict=True):
            fit = self._candidates[t][k]
            self.poses[t], self.error[t] = fit.pose, fit.error

    def _beam(self, t: int) -> Beam:
        """The candidates of a frame."""
        model, fits = self.body.model, self._candidates[t]
        poses, errors = [fit.pose for fit in fits], np.array([fit.error for fit in fits])
        return Beam.of_frame(
            poses,
            joints_of(model, poses),
            errors,
            self._frame_costs(t, fits),
            float(self._times_s[t]),
            np.zeros((len(fits), len(model.names)), np.bool_),  # some camera sees each part
            [None] * len(fits),
        )
