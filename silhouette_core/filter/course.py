"""From posteriors to a course of poses, block by block, so that memory does not grow with the length of a video."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.estimator import Clock
from silhouette_core.filter.forward import Belief
from silhouette_core.filter.limbs import SignedPicture
from silhouette_core.filter.recombination import Recombiner, Shot
from silhouette_core.filter.tracks import States, Tracks, TrackSettings, best_course
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.filter.window import look_at
from silhouette_core.fitting.agreement import silhouette_error
from silhouette_core.fitting.observation import Observation
from silhouette_core.fitting.pose import Pose
from silhouette_core.library.pictures import STATURE_PX

_BLOCK, _AHEAD = 150, 45
_HIDDEN_SHARE = 0.15  # T_A of eq. (3), as the library has it: of a part's usual largest area


@dataclass(frozen=True, eq=False)
class Posed:
    """A frame of the course.

    Attributes:
        number, time_s: of the frame.
        pose: its pose.
        error: |XOR| / |OR| of the silhouettes.
        hidden: (27,) bool, parts that the pose does not show, eq. (3).
        cut: the picture's border cuts the person.
        lost: no pose of the library resembled the silhouette as usual.
    """

    number: int
    time_s: float
    pose: Pose
    error: float
    hidden: NDArray[np.bool_]
    cut: bool
    lost: bool


@dataclass(frozen=True, eq=False)
class _Waiting:
    """A frame that is not decided yet: what of a belief is needed later, its silhouette as bits."""

    number: int
    time_s: float
    bits: NDArray[np.uint8]
    cut: bool
    lost: bool
    states: States


class Course:
    """Takes posteriors and gives poses.

    Args:
        tree: the filter.
        camera: without distortion.
        settings: how poses are followed.
        smooth: look ahead; otherwise every frame is decided at once from the past.
        clock: keeps the time of the stages.

    Attributes:
        distance_m: of the person in the latest frame, as its likeliest refined pose has it.
    """

    def __init__(self, tree: TreeFilter, camera: Camera, settings: TrackSettings, smooth: bool, clock: Clock):
        """Prepares the body."""
        self.camera, self.settings, self.smooth, self.clock = camera, settings, smooth, clock
        self.model = tree.library.model
        self.tracks = Tracks(tree, camera, settings)
        self.recombiner = Recombiner(self.model, self.tracks.views, tree.library.base_angles.astype(float)) if settings.refine else None
        self._usual_areas = np.percentile(tree.library.areas, 99, axis=0)
        self.distance_m = np.nan
        self._waiting: list[_Waiting] = []
        self._decided: _Waiting | None = None
        self._before: Shot | None = None

    def add(self, belief: Belief) -> list[Posed]:
        """Takes a frame's posterior; returns the frames that are decided by it, oldest first."""
        past = [frame.states for frame in ([self._decided] if self._decided else []) + self._waiting[-2:]][-2:]
        if belief.lost and past and belief.time_s - past[-1].time_s > 1.0:
            past = []
        with self.clock("several poses"):
            states = self.tracks.step(belief, past[-1] if past else None, past[0] if len(past) > 1 else None)
        best = states.poses[int(states.cost.argmin())]
        self.distance_m = float((best.root_m - self.camera.center_m) @ belief.windows[0].world_from_virtual[:, 2])
        bits = np.packbits(belief.person.mask, axis=1)
        self._waiting.append(_Waiting(belief.number, belief.time_s, bits, belief.person.cut, belief.lost, states))
        if not self.smooth:
            return self._decide(1)
        return self._decide(_BLOCK) if len(self._waiting) >= _BLOCK + _AHEAD else []

    def finish(self) -> list[Posed]:
        """Returns the frames still undecided."""
        return self._decide(len(self._waiting)) if self._waiting else []

    def _decide(self, count: int) -> list[Posed]:
        taken = best_course([frame.states for frame in self._waiting])
        shots = [self._shot(frame, frame.states.poses[k]) for frame, k in zip(self._waiting, taken, strict=True)]
        if self.recombiner is not None:
            with self.clock("limbs"):
                shots = self.recombiner.recombine(shots, self._before)
            with self.clock("refinement"):
                shots = self.recombiner.refine(shots, self._before)
        decided = [self._posed(frame, shot) for frame, shot in zip(self._waiting[:count], shots, strict=False)]
        self._decided, self._before = self._waiting[count - 1], shots[count - 1]
        del self._waiting[:count]
        return decided

    def _shot(self, frame: _Waiting, pose: Pose) -> Shot:
        distance = float(np.linalg.norm(pose.root_m - self.camera.center_m))
        mask = np.unpackbits(frame.bits, axis=1, count=self.camera.size[0]).view(bool)
        window = look_at(self.camera, mask, distance, STATURE_PX / self.model.sizes.stature_m)
        return Shot(pose, mask, SignedPicture.of(window, self.settings.weighting), distance, frame.time_s)

    def _posed(self, frame: _Waiting, shot: Shot) -> Posed:
        error = silhouette_error(self.model, shot.pose, Observation.of(self.tracks.views, [shot.mask], shot.distance_m))
        hidden = shot.picture.part_areas(self.model, shot.pose) < _HIDDEN_SHARE * self._usual_areas
        return Posed(frame.number, frame.time_s, shot.pose, error, hidden, frame.cut, frame.lost)
