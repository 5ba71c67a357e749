"""From posteriors to a course of poses, block by block, so that memory does not grow with the
length of a video.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.filter.forward import FilterFrame
from silhouette_core.filter.hypothesis_tracker import (
    Beam,
    HypothesisTracker,
    TrackerSettings,
    backtrack,
)
from silhouette_core.filter.limb_resampling import LimbResampler, PoseFrame
from silhouette_core.filter.limb_silhouette import SignedWeights
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.filter.window import look_at
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.progress import StageClock
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.pose import Pose
from silhouette_core.refinement.silhouette_error import silhouette_error

_BLOCK, _AHEAD = 150, 45
_OCCLUDED_SHARE = 0.15  # T_A of eq. (3), as the library has it: of a part's usual largest area


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """A frame of the course.

    Attributes:
        number, time_s: of the frame.
        pose: its pose.
        error: |XOR| / |OR| of the silhouettes.
        occluded: (27,) bool, parts that the pose does not show, eq. (3).
        cut: the picture's border cuts the person.
        lost: no pose of the library resembled the silhouette as usual.
    """

    number: int
    time_s: float
    pose: Pose
    error: float
    occluded: NDArray[np.bool_]
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
    states: Beam


class PoseTrajectory:
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

    def __init__(
        self,
        tree: TreeFilter,
        camera: Camera,
        settings: TrackerSettings,
        smooth: bool,
        clock: StageClock,
    ):
        """Prepares the body."""
        self.camera, self.settings, self.smooth, self.clock = camera, settings, smooth, clock
        self.model = tree.library.model
        self.tracks = HypothesisTracker(tree, camera, settings)
        self.resampler = (
            LimbResampler(self.model, self.tracks.views, tree.library.base_angles.astype(float))
            if settings.refine
            else None
        )
        self._usual_areas = np.percentile(tree.library.areas, 99, axis=0)
        self.distance_m = np.nan
        self._waiting: list[_Waiting] = []
        self._decided: _Waiting | None = None
        self._before: PoseFrame | None = None

    def add(self, filter_frame: FilterFrame) -> list[FrameEstimate]:
        """Takes a frame's posterior; returns the frames that are decided by it, oldest first."""
        past = [
            frame.states
            for frame in ([self._decided] if self._decided else []) + self._waiting[-2:]
        ][-2:]
        if filter_frame.lost and past and filter_frame.time_s - past[-1].time_s > 1.0:
            past = []
        with self.clock("several poses"):
            states = self.tracks.step(
                filter_frame, past[-1] if past else None, past[0] if len(past) > 1 else None
            )
        best = states.poses[int(states.cost.argmin())]
        self.distance_m = float(
            (best.root_m - self.camera.center_m) @ filter_frame.windows[0].world_from_virtual[:, 2]
        )
        bits = np.packbits(filter_frame.person.mask, axis=1)
        self._waiting.append(
            _Waiting(
                filter_frame.number,
                filter_frame.time_s,
                bits,
                filter_frame.person.cut,
                filter_frame.lost,
                states,
            )
        )
        if not self.smooth:
            return self._decide(1)
        return self._decide(_BLOCK) if len(self._waiting) >= _BLOCK + _AHEAD else []

    def finish(self) -> list[FrameEstimate]:
        """Returns the frames still undecided."""
        return self._decide(len(self._waiting)) if self._waiting else []

    def _decide(self, count: int) -> list[FrameEstimate]:
        taken = backtrack([frame.states for frame in self._waiting])
        pose_frames = [
            self._pose_frame(frame, frame.states.poses[k])
            for frame, k in zip(self._waiting, taken, strict=True)
        ]
        if self.resampler is not None:
            with self.clock("limbs"):
                pose_frames = self.resampler.resample(pose_frames, self._before)
            with self.clock("refinement"):
                pose_frames = self.resampler.refine(pose_frames, self._before)
        decided = [
            self._posed(frame, pose_frame)
            for frame, pose_frame in zip(self._waiting[:count], pose_frames, strict=False)
        ]
        self._decided, self._before = self._waiting[count - 1], pose_frames[count - 1]
        del self._waiting[:count]
        return decided

    def _pose_frame(self, frame: _Waiting, pose: Pose) -> PoseFrame:
        distance = float(np.linalg.norm(pose.root_m - self.camera.center_m))
        mask = np.unpackbits(frame.bits, axis=1, count=self.camera.size[0]).view(bool)
        window = look_at(self.camera, mask, distance, STATURE_PX / self.model.sizes.stature_m)
        return PoseFrame(
            pose, mask, SignedWeights.of(window, self.settings.weighting), distance, frame.time_s
        )

    def _posed(self, frame: _Waiting, pose_frame: PoseFrame) -> FrameEstimate:
        error = silhouette_error(
            self.model,
            pose_frame.pose,
            Observation.of(self.tracks.views, [pose_frame.mask], pose_frame.distance_m),
        )
        occluded = (
            pose_frame.picture.part_areas(self.model, pose_frame.pose)
            < _OCCLUDED_SHARE * self._usual_areas
        )
        return FrameEstimate(
            frame.number, frame.time_s, pose_frame.pose, error, occluded, frame.cut, frame.lost
        )
