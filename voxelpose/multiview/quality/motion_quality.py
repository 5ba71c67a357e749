"""Quality of all frames of a fitted motion, as written: agreement with the hull and with the
silhouettes, and the errors to be expected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from voxelpose.multiview.quality.expected_error import (
    FrameEvidence,
    MotionEvidence,
    expected_errors,
    frame_evidence,
    half_turn_ratio,
)
from voxelpose.multiview.quality.quality import Quality, assess
from voxelpose.multiview.tracking.tracking import PoseTracker

_TOGETHER = 8  # frames
_TURNED = 5  # frames in which the body is turned half round


@dataclass(frozen=True, eq=False)
class MotionQuality:
    """Quality of T poses.

    Attributes:
        arrays: by name, T rows each, as of `Motion.quality`.
        half_turn_ratio: median ratio by which bodies turned half round explain the silhouettes
            worse; 1: as well; NaN where no frame shows the person.
    """

    arrays: dict[str, np.ndarray]
    half_turn_ratio: float


def motion_quality(
    tracker: PoseTracker, motion: Motion, steps: list[int], clock: StageClock, reporter: Reporter
) -> MotionQuality:
    """Assesses a motion.

    Args:
        tracker: has the observations of all frames.
        motion: T poses in the tracker's world.
        steps: T time steps of the poses.
        clock: told the durations.
        reporter: told every frame.
    """
    body, joints_m = tracker.body, motion.landmarks()
    points = np.array([len(part) for part in body.body_volume.part_points])
    rotation = rotation_matrices(motion.root_quaternion)

    def pose_of(row: int) -> Pose:
        return Pose(motion.root_m[row], rotation[row], motion.angles_rad[row])

    def assessed(row: int) -> tuple[Quality, FrameEvidence] | None:
        frame = tracker.observe(steps[row])
        if frame is None:
            return None
        pose = pose_of(row)
        quality = assess(body.body_volume, pose, frame)
        outside = 1 - float(np.nansum(quality.part_overlap * points)) / points.sum()
        # Of all frames, the voxels would fill the memory of a long recording.
        quality = replace(quality, unexplained_voxels=quality.unexplained_voxels[:0].copy())
        return quality, frame_evidence(body, pose, joints_m[row], frame, outside)

    found: list[tuple[Quality, FrameEvidence] | None] = []
    for first in range(0, len(motion), _TOGETHER):
        rows = range(first, min(first + _TOGETHER, len(motion)))
        with clock("quality"):
            found += side_by_side(assessed, rows)
        for _ in rows:
            reporter.advance()
    ratio = np.nan
    if body.model.person is not None:
        with clock("half turn"):
            ratio = _half_turn(tracker, pose_of, steps)
    nothing = FrameEvidence(
        np.full(len(tracker.observations.observer.views.rig), np.nan),
        np.full(len(body.model.landmarks_m), np.nan),
        np.nan,
        np.full(len(body.model.landmarks_m), np.nan),
    )
    frames = [nothing if one is None else one[1] for one in found]
    camera_error = np.stack([frame.camera_error for frame in frames])
    parts = len(body.model.names)
    arrays = {
        "part_overlap": np.stack(
            [np.full(parts, np.nan) if one is None else one[0].part_overlap for one in found]
        ),
        "part_unsupported": np.stack(
            [np.zeros(parts, bool) if one is None else one[0].part_unsupported for one in found]
        ),
        "unexplained": np.array([np.nan if one is None else one[0].unexplained for one in found]),
        "outside": np.array([frame.outside for frame in frames]),
        "outline_agreement": 1 - camera_error.mean(axis=1),
        "camera_agreement": 1 - camera_error,
        "joint_disagreement": np.stack([frame.joint_error for frame in frames]),
        "joint_sigma_mm": 1000 * np.stack([frame.joint_sigma_m for frame in frames]),
    }
    if body.model.person is None:  # the regression is of people
        return MotionQuality(arrays, ratio)
    evidence = MotionEvidence.from_motion(replace(motion, quality=arrays), ratio)
    expected = expected_errors(evidence)
    arrays |= {
        "right_probability": np.nan_to_num(expected.right_probability),
        "joint_error_mm": expected.median_mm,
        "landmark_confidence": np.nan_to_num(expected.near_probability),
    }
    return MotionQuality(arrays, ratio)


def _half_turn(tracker: PoseTracker, pose_of: Callable[[int], Pose], steps: list[int]) -> float:
    """Median half-turn ratio of a few frames, NaN where none shows the person."""
    rows = np.linspace(0, len(steps) - 1, min(len(steps), _TURNED)).round().astype(int)

    def ratio(row: int) -> float:
        frame = tracker.observe(steps[row])
        if frame is None:
            return np.nan
        return half_turn_ratio(tracker.body, pose_of(row), frame, tracker.settings.match)

    ratios = np.array(side_by_side(ratio, np.unique(rows).tolist()))
    return float(np.nanmedian(ratios)) if np.isfinite(ratios).any() else np.nan
