"""Trajectory of poses: proposals, hypotheses and their refinement over time.

Frames are decided in blocks, so that memory does not grow with the length of a video.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.checks import BoolArray, ByteArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, ObservedFrame, Proposer
from silhouette_core.monocular.tuning import DISTANCES
from silhouette_core.motion.kinematics import centres_of
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import StageClock
from silhouette_core.scoring.silhouette_error import mask_errors
from silhouette_core.tracking.beam import Beam, backtrack
from silhouette_core.tracking.trajectory_fit import FrameEvidence, fit_trajectory

_BLOCK, _AHEAD = 150, 45  # frames decided together, and frames that must follow them
_REMEMBERED = 60  # frames whose median distance is the usual one


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """A frame of the trajectory."""

    number: int
    time_s: float
    pose: Pose
    error: float  #: |XOR| / |OR| of the silhouettes.
    occluded: BoolArray  #: (27,) bool, occlusion flags of the parts in this pose, eq. (3).
    cut: bool  #: the border of the image cuts the person.
    lost: bool  #: no hypothesis fits about as well as the best ones of earlier frames.
    probability: FloatArray  #: (n,) float64, of the hypotheses of the frame, likeliest first.
    joints: FloatArray  #: (n, 15, 3) float64, their joints in the world, m.


@dataclass(frozen=True, eq=False)
class PendingFrame:
    """A frame that is not decided yet."""

    number: int
    time_s: float
    person: Person  #: the silhouette, without its picture.
    bits: ByteArray  #: (h, w / 8) uint8, the silhouette, packed.
    width: int
    note: Any  #: what the proposer keeps of it.

    @classmethod
    def of(cls, number: int, time_s: float, person: Person, note: Any) -> "PendingFrame":
        """Packs a frame; see the attributes."""
        bare = replace(person, mask=np.zeros((0, 0), bool))
        bits = np.packbits(person.mask, axis=1)
        return cls(number, time_s, bare, bits, person.mask.shape[1], note)

    def seen(self) -> Person:
        """The silhouette with its picture."""
        mask = np.unpackbits(self.bits, axis=1, count=self.width).view(bool)
        return replace(self.person, mask=mask)


class PoseTrajectory:
    """Trajectory of poses, frame by frame.

    Args:
        smooth: decide frames with knowledge of later ones; otherwise at once, from the past.
    """

    def __init__(
        self, tracker: HypothesisTracker, proposer: Proposer, smooth: bool, clock: StageClock
    ):
        self.tracker, self.proposer = tracker, proposer
        self.smooth, self.clock = smooth, clock
        self._pending: list[PendingFrame] = []
        self._past: list[Beam] = []  # of the last two decided frames, the chosen hypothesis alone
        self._decided: list[Pose] = []
        self._usual: deque[float] = deque(maxlen=_REMEMBERED)  # distances of frames not lost

    @property
    def model(self) -> BodyModel:
        """The body, adapted to the person once there are frames enough."""
        return self.tracker.model

    def add(self, frame: PendingFrame) -> list[FrameEstimate]:
        """Adds a frame; returns the frames that are decided by it, oldest first."""
        self._pending.append(frame)
        if not self.smooth:
            return self._decide(1)
        return self._decide(_BLOCK) if len(self._pending) >= _BLOCK + _AHEAD else []

    def finish(self) -> list[FrameEstimate]:
        """Returns the frames still undecided."""
        return self._decide(len(self._pending)) if self._pending else []

    def _decide(self, count: int) -> list[FrameEstimate]:
        people = [frame.seen() for frame in self._pending]
        with self.clock("proposal"):
            notes = [frame.note for frame in self._pending]
            proposals = self.proposer.propose(notes, people, first=not self._decided)
        if self.proposer.model is not self.tracker.model:
            self.tracker.set_body(self.proposer.model)
        with self.clock("several poses"):
            observed = [
                self._observed(frame, person, proposal)
                for frame, person, proposal in zip(self._pending, people, proposals, strict=True)
            ]
            beams = self._beams(observed, proposals)
        chosen = backtrack(beams)
        with self.clock("refinement"):
            poses = self._refined(observed, beams, chosen)
        if not self.smooth:
            joints = beams[0].joints[chosen[0]]
            self.proposer.learn(self._pending[0].number, people[0], joints)
        decided = [
            self._estimate(frame, seen, pose, beam, k)
            for frame, seen, pose, beam, k in zip(
                self._pending[:count], observed, poses, beams, chosen, strict=False
            )
        ]
        ends = range(max(count - 2, 0), count)
        self._past = [*self._past, *(beams[k].only(chosen[k]) for k in ends)][-2:]
        self._decided = [*self._decided, *(poses[k] for k in ends)][-2:]
        del self._pending[:count]
        return decided

    def _observed(
        self, frame: PendingFrame, person: Person, proposal: FrameProposal
    ) -> ObservedFrame:
        """A pending frame, prepared for its hypotheses."""
        return self.tracker.observe(person.mask, proposal.distance_m, frame.time_s, proposal.window)

    def _beams(
        self, observed: list[ObservedFrame], proposals: Sequence[FrameProposal]
    ) -> list[Beam]:
        """Hypotheses of all pending frames."""
        beams: list[Beam] = []
        for seen, proposal in zip(observed, proposals, strict=True):
            past = _last_two([*self._past, *beams[-2:]], seen.time_s)
            beams.append(self.tracker.step(seen, proposal, past))
        if not (self.smooth and self.tracker.settings.both_ways):
            return beams
        return self._both_ways(observed, proposals, beams)

    def _both_ways(
        self, observed: list[ObservedFrame], proposals: Sequence[FrameProposal], beams: list[Beam]
    ) -> list[Beam]:
        """Hypotheses tracked back from the last frame, too: what it shows helps those before it."""
        step, backward = self.tracker.step, list[Beam]()
        frames = list(zip(observed, proposals, beams, strict=True))
        for seen, proposal, known in reversed(frames):
            before = replace(seen, time_s=-seen.time_s)
            backward.append(step(before, proposal, _last_two(backward, before.time_s), known))
        result: list[Beam] = []
        for (seen, proposal, _), known in zip(frames, reversed(backward), strict=True):
            past = _last_two([*self._past, *result[-2:]], seen.time_s)
            result.append(step(seen, proposal, past, known, searched=False))
        return result

    def _refined(
        self, observed: list[ObservedFrame], beams: list[Beam], chosen: list[int]
    ) -> list[Pose]:
        """Poses of all pending frames, refined together."""
        return fit_trajectory(
            self.tracker.surface,
            [
                FrameEvidence(seen.contour, seen.time_s, beam.priors[k])
                for seen, beam, k in zip(observed, beams, chosen, strict=True)
            ],
            [beam.poses[k] for beam, k in zip(beams, chosen, strict=True)],
            self.tracker.costs.stood_on,
            live=not self.smooth,
            before=self._decided,
        )

    def _estimate(
        self, frame: PendingFrame, observed: ObservedFrame, pose: Pose, beam: Beam, chosen: int
    ) -> FrameEstimate:
        """Result of a frame, whose pose comes from one of its hypotheses."""
        tracker = self.tracker
        views, backend = tracker.views, tracker.backend
        (error,) = mask_errors(tracker.model, [pose], views, [observed.mask], backend)
        best = float(beam.distance.min())
        usual = float(np.median(self._usual)) if self._usual else best
        lost = best > DISTANCES.lost_factor * usual + DISTANCES.lost_excess
        if not lost:
            self._usual.append(best)
        probability, poses = beam.probabilities(tracker.settings.temperature)
        return FrameEstimate(
            frame.number,
            frame.time_s,
            pose,
            error,
            beam.occluded[chosen],
            frame.person.cut,
            lost,
            probability,
            centres_of(tracker.model, poses),
        )


def _last_two(beams: Sequence[Beam], time_s: float) -> tuple[Beam | None, Beam | None]:
    """The last hypotheses before a time and those before them, where there are any; after a gap, a
    trajectory begins anew.
    """
    if not beams or time_s - beams[-1].time_s > DISTANCES.longest_gap_s:
        return None, None
    return beams[-1], beams[-2] if len(beams) > 1 else None
