"""Trajectory of poses from the posteriors of the frames.

Frames are decided in blocks, so that memory does not grow with the length of a video.
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
from silhouette_core.library.occlusion import occluded_parts, usual_areas
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import StageClock
from silhouette_core.refinement.observation import Observation
from silhouette_core.scoring.silhouette_error import silhouette_error

_BLOCK, _AHEAD = 150, 45  # frames decided together, and frames that must follow them
_LONGEST_GAP_S = 1.0


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """A frame of the trajectory.

    Attributes:
        number: number of the frame in the recording.
        time_s: time of the frame.
        pose: estimated pose.
        error: |XOR| / |OR| of the silhouettes.
        occluded: (27,) bool, occlusion flags of the parts in this pose, eq. (3).
        cut: the border of the image cuts the person.
        lost: the filter had lost the person.
    """

    number: int
    time_s: float
    pose: Pose
    error: float
    occluded: NDArray[np.bool_]
    cut: bool
    lost: bool


@dataclass(frozen=True, eq=False)
class _PendingFrame:
    """A frame that is not decided yet.

    Attributes:
        number: number of the frame in the recording.
        time_s: time of the frame.
        bits: (h, w / 8) uint8, the silhouette, packed.
        cut: the border of the image cuts the person.
        lost: the filter had lost the person.
        beam: the frame's pose hypotheses.
    """

    number: int
    time_s: float
    bits: NDArray[np.uint8]
    cut: bool
    lost: bool
    beam: Beam


class PoseTrajectory:
    """Trajectory of poses, frame by frame.

    Args:
        tree: the tree filter.
        camera: pinhole camera without distortion.
        settings: how hypotheses are tracked.
        smooth: decide frames with knowledge of later ones; otherwise at once, from the past.
        clock: times the stages.

    Attributes:
        distance_m: distance of the person in the latest frame, from its cheapest hypothesis.
    """

    def __init__(
        self,
        tree: TreeFilter,
        camera: Camera,
        settings: TrackerSettings,
        smooth: bool,
        clock: StageClock,
    ):
        """Prepares tracker and resampler."""
        self.camera, self.settings, self.smooth, self.clock = camera, settings, smooth, clock
        self.model = tree.library.model
        self.tracker = HypothesisTracker(tree, camera, settings)
        self.resampler = (
            LimbResampler(self.model, self.tracker.views, tree.library.base_angles.astype(float))
            if settings.refine
            else None
        )
        self._usual_areas = usual_areas(tree.library.areas)
        self.distance_m = np.nan
        self._pending: list[_PendingFrame] = []
        self._decided: _PendingFrame | None = None
        self._decided_pose: PoseFrame | None = None

    def add(self, filter_frame: FilterFrame) -> list[FrameEstimate]:
        """Adds a frame; returns the frames that are decided by it, oldest first."""
        past = [
            frame.beam for frame in ([self._decided] if self._decided else []) + self._pending[-2:]
        ][-2:]
        if filter_frame.lost and past and filter_frame.time_s - past[-1].time_s > _LONGEST_GAP_S:
            past = []
        with self.clock("several poses"):
            beam = self.tracker.step(
                filter_frame, past[-1] if past else None, past[0] if len(past) > 1 else None
            )
        best = beam.poses[beam.best]
        self.distance_m = float(
            (best.root_m - self.camera.center_m) @ filter_frame.windows[0].world_from_virtual[:, 2]
        )
        bits = np.packbits(filter_frame.person.mask, axis=1)
        self._pending.append(
            _PendingFrame(
                filter_frame.number,
                filter_frame.time_s,
                bits,
                filter_frame.person.cut,
                filter_frame.lost,
                beam,
            )
        )
        if not self.smooth:
            return self._decide(1)
        return self._decide(_BLOCK) if len(self._pending) >= _BLOCK + _AHEAD else []

    def finish(self) -> list[FrameEstimate]:
        """Returns the frames still undecided."""
        return self._decide(len(self._pending)) if self._pending else []

    def _decide(self, count: int) -> list[FrameEstimate]:
        chosen = backtrack([frame.beam for frame in self._pending])
        pose_frames = [
            self._pose_frame(frame, frame.beam.poses[k])
            for frame, k in zip(self._pending, chosen, strict=True)
        ]
        if self.resampler is not None:
            with self.clock("limbs"):
                pose_frames = self.resampler.resample(pose_frames, self._decided_pose)
            with self.clock("refinement"):
                pose_frames = self.resampler.refine(pose_frames, self._decided_pose)
        decided = [
            self._estimate(frame, pose_frame)
            for frame, pose_frame in zip(self._pending[:count], pose_frames, strict=False)
        ]
        self._decided, self._decided_pose = self._pending[count - 1], pose_frames[count - 1]
        del self._pending[:count]
        return decided

    def _pose_frame(self, frame: _PendingFrame, pose: Pose) -> PoseFrame:
        distance = float(np.linalg.norm(pose.root_m - self.camera.center_m))
        mask = np.unpackbits(frame.bits, axis=1, count=self.camera.size[0]).view(bool)
        window = look_at(self.camera, mask, distance, STATURE_PX / self.model.sizes.stature_m)
        return PoseFrame(
            pose,
            mask,
            SignedWeights.from_window(
                window,
                self.settings.weighting,
                backend=self.tracker.tree.backend,
                bounds_px=self.tracker.tree.library.bounds_px,
            ),
            distance,
            frame.time_s,
        )

    def _estimate(self, frame: _PendingFrame, pose_frame: PoseFrame) -> FrameEstimate:
        error = silhouette_error(
            self.model,
            pose_frame.pose,
            Observation.from_masks(self.tracker.views, [pose_frame.mask], pose_frame.distance_m),
            self.tracker.tree.backend,
        )
        areas = pose_frame.weights.part_areas(self.model, pose_frame.pose)
        occluded = occluded_parts(areas, self._usual_areas)
        return FrameEstimate(
            frame.number, frame.time_s, pose_frame.pose, error, occluded, frame.cut, frame.lost
        )
