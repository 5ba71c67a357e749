"""Agreement of a fitted pose with the hull, part by part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter

from silhouette_core.motion.kinematics import forward, quaternions, rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.read_ahead import side_by_side
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.body_volume import BodyVolume, VoxelSet
from voxelpose.multiview.quality.expected_error import (
    MotionEvidence,
    expected_errors,
    frame_evidence,
    half_turn_ratio,
)
from voxelpose.multiview.tracking.tracking import PoseTracker
from voxelpose.multiview.tuning import QUALITY

_TOGETHER = 8  # frames
_TURNED = 5  # frames in which the body is turned half round


@dataclass(frozen=True, eq=False)
class Quality:
    """Agreement of one frame's pose with the hull.

    A hull of few cameras is larger than the body in it.

    Attributes:
        part_overlap: (27,) float64, fraction of each part's volume inside the hull; NaN for a part
            smaller than a voxel.
        unexplained: fraction of the hull's voxels that no part covers, nor a neighbour of which:
            a part's points leave gaps of a voxel.
        unexplained_voxels: (n, 3) int64, indices of those voxels in the frame's grid.
    """

    part_overlap: np.ndarray
    unexplained: float
    unexplained_voxels: np.ndarray


def assess(body_volume: BodyVolume, pose: Pose, frame: FrameObservation) -> Quality:
    """Agreement of a posed body with a frame's hull."""
    voxel_set = VoxelSet(frame.grid, frame.occupancy, body_volume.backend)
    rotation, origin = forward(
        body_volume.model,
        pose.root_m[None],
        quaternions(pose.root_rotation[None]),
        pose.angles_rad[None],
    )
    overlap = np.full(len(body_volume.model.names), np.nan)
    union = np.zeros(voxel_set.words, np.uint64)
    for part, points in enumerate(body_volume.part_points):
        if len(points):
            bits, empty, _ = voxel_set.cover(points, rotation[0, part][None], origin[0, part][None])
            overlap[part] = 1 - empty[0] / len(points)
            union |= bits[0]
    covered = np.zeros(frame.occupancy.shape, bool)
    covered[tuple(voxel_set.voxels(union).T)] = True
    near = np.asarray(maximum_filter(covered, 3), np.bool_)
    unexplained = np.argwhere(frame.occupancy & ~near)
    return Quality(
        overlap,
        len(unexplained) / max(len(voxel_set), 1),
        unexplained,
    )


def motion_quality(
    tracker: PoseTracker, motion: Motion, steps: list[int], clock: StageClock, reporter: Reporter
) -> tuple[dict[str, np.ndarray], float]:
    """Assesses a motion.

    Args:
        motion: T poses in the tracker's world.
        steps: T time steps of the poses.

    Returns:
        Arrays of T rows by name, as of `Motion.quality`; and the median ratio by which bodies
        turned half round explain the silhouettes worse, 1: as well, NaN where no frame shows the
        person.
    """
    body, joints_m = tracker.body, motion.landmarks()
    points = np.array([len(part) for part in body.body_volume.part_points])
    rotation = rotation_matrices(motion.root_quaternion)
    marks = np.full(len(body.model.landmarks_m), np.nan)
    nothing = {
        "part_overlap": np.full(len(points), np.nan),
        "unexplained": np.array(np.nan),
        "outside": np.array(np.nan),
        "camera_agreement": np.full(len(tracker.observations.observer.views.rig), np.nan),
        "joint_disagreement": marks,
        "joint_sigma_mm": marks,
    }

    def pose_of(row: int) -> Pose:
        return Pose(motion.root_m[row], rotation[row], motion.angles_rad[row])

    def assessed(row: int) -> dict[str, np.ndarray]:
        frame = tracker.observe(steps[row])
        if frame is None:
            return nothing
        pose = pose_of(row)
        quality = assess(body.body_volume, pose, frame)
        outside = 1 - float(np.nansum(quality.part_overlap * points)) / points.sum()
        return {
            "part_overlap": quality.part_overlap,
            "unexplained": np.array(quality.unexplained),
            "outside": np.array(outside),
        } | frame_evidence(body, pose, joints_m[row], frame)

    found: list[dict[str, np.ndarray]] = []
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
    arrays = {name: np.stack([frame[name] for frame in found]) for name in nothing}
    arrays["part_unsupported"] = arrays["part_overlap"] < QUALITY.unsupported
    arrays["outline_agreement"] = arrays["camera_agreement"].mean(axis=1)
    if body.model.person is None:  # the regression is of people
        return arrays, ratio
    evidence = MotionEvidence.from_motion(replace(motion, quality=arrays), ratio)
    arrays |= expected_errors(evidence)
    for name in ("right_probability", "landmark_confidence"):
        arrays[name] = np.nan_to_num(arrays[name])
    return arrays, ratio


def _half_turn(tracker: PoseTracker, pose_of: Callable[[int], Pose], steps: list[int]) -> float:
    """Median half-turn ratio of a few frames, NaN where none shows the person."""
    rows = np.linspace(0, len(steps) - 1, min(len(steps), _TURNED)).round().astype(int)

    def ratio(row: int) -> float:
        frame = tracker.observe(steps[row])
        if frame is None:
            return np.nan
        return half_turn_ratio(tracker.body, pose_of(row), frame, tracker.matching)

    ratios = np.array(side_by_side(ratio, np.unique(rows).tolist()))
    return float(np.nanmedian(ratios)) if np.isfinite(ratios).any() else np.nan
