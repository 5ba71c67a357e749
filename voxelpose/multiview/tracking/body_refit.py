"""The body adapted again, to clear frames of the whole recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.moments import even_moments
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.surface import Surface
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.pose_search import BodyGeometry, sampled_vertices
from voxelpose.multiview.person.body_choice import Start, adapted
from voxelpose.multiview.tracking.tracking import PoseTracker

REFIT_FRAMES = 12
"""Frames of a recording to which the body is adapted again, and by which tracks are compared."""
_OTHER_SEX = {"male": "female", "female": "male"}
_NECK = LANDMARK_NAMES.index("neck")


def refit(tracker: PoseTracker, start: Start, any_sex: bool) -> None:
    """Adapts the tracker's body again. A body that stays as it is, is left so.

    Args:
        tracker: with poses, which follow where the other template is taken.
        start: what tracking started from.
        any_sex: whether the template of the other sex is tried as well; the more probable body of
            both is taken.
    """
    if start.prior.covariance is None:
        return
    frames = _clear_frames(tracker)
    poses = {t: pose for t in frames if (pose := tracker.poses[t]) is not None}
    own = tracker.body.model
    starts = [replace(start, body=tracker.body, poses=poses, errors={})]
    if any_sex:
        starts.append(_of_other_sex(starts[0], tracker))
    best = min(side_by_side(lambda one: adapted(one, frames), starts), key=Start.cost)
    tracker.body = best.body
    if best.body.model.sizes.sex != own.sizes.sex:
        tracker.poses = [
            None if pose is None else with_joints_of(best.body.model, own, pose)
            for pose in tracker.poses
        ]


def spread_errors(tracker: PoseTracker) -> list[float]:
    """Silhouette errors of frames that are spread over a recording."""
    return tracker.error[even_moments(len(tracker.error), REFIT_FRAMES)].tolist()


def _clear_frames(tracker: PoseTracker) -> dict[int, FrameObservation]:
    """Frames whose poses explain the silhouettes as well as usual, spread over the recording."""
    posed = np.flatnonzero(np.isfinite(tracker.error))
    clear = posed[tracker.error[posed] <= np.median(tracker.error[posed]) * 1.1]
    chosen = clear[even_moments(len(clear), REFIT_FRAMES)].tolist()
    return {t: frame for t in chosen if (frame := tracker.observe(t)) is not None}


def _of_other_sex(start: Start, tracker: PoseTracker) -> Start:
    """Start with the template of the other sex, of the same deviations."""
    own, backend = start.body.model, start.body.body_volume.backend
    sizes = replace(own.sizes, sex=_OTHER_SEX[own.sizes.sex])
    template = BodyModel.from_sizes(sizes)
    surface = Surface(template.reshaped(own.shape), taken=sampled_vertices(sizes.sex))
    voxel_size_m = tracker.observations.observer.voxel_size_m
    return replace(
        start,
        candidate=replace(start.candidate, template=sizes.sex),
        body=BodyGeometry.from_surface(surface, voxel_size_m, backend),
        prior=replace(start.prior, expected=template.shape),
        poses={t: with_joints_of(surface.model, own, pose) for t, pose in start.poses.items()},
    )


def with_joints_of(model: BodyModel, other: BodyModel, pose: Pose) -> Pose:
    """A pose of another body with the root where a body has it whose neck is in the same place."""
    higher = (other.landmarks_m[_NECK] - other.joints_m[0]) - (
        model.landmarks_m[_NECK] - model.joints_m[0]
    )
    return Pose(pose.root_m + pose.root_rotation @ higher, pose.root_rotation, pose.angles_rad)
