"""The body adapted again, to clear frames of the whole recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.population import sex_probability
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.pose import Pose
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature, adapt_shape, stature_of
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.pose_search import BodyGeometry, sampled_vertices
from voxelpose.multiview.person.body_choice import Start
from voxelpose.multiview.tracking.tracking import PoseTracker

_FRAMES = 12
_INDEPENDENT = 100.0  # residuals of all frames that count as independent of each other
_OTHER_SEX = {"male": "female", "female": "male"}
_NECK = LANDMARK_NAMES.index("neck")


@dataclass(frozen=True, eq=False)
class AdaptedBody:
    """A body adapted to some frames.

    Attributes:
        surface: of the body.
        poses: of the frames, refined on it.
        error: mean silhouette error in the frames.
        cost: negative logarithm of the body's posterior probability, up to a constant.
    """

    surface: Surface
    poses: list[Pose]
    error: float
    cost: float


def clear_frames(tracker: PoseTracker, count: int) -> dict[int, FrameObservation]:
    """Frames whose poses explain the silhouettes as well as usual, spread over the recording.

    Args:
        tracker: with poses.
        count: most frames.
    """
    posed = np.flatnonzero(np.isfinite(tracker.error))
    clear = posed[tracker.error[posed] <= np.median(tracker.error[posed]) * 1.1]
    spaced = np.linspace(0, len(clear) - 1, min(len(clear), count)).astype(int)
    return {
        int(t): frame
        for t in clear[np.unique(spaced)]
        if (frame := tracker.observe(int(t))) is not None
    }


def refit(tracker: PoseTracker, start: Start, any_sex: bool) -> None:
    """Adapts the tracker's body again. A body that stays as it is, is left so.

    Args:
        tracker: with poses, which follow where the other template is taken.
        start: what tracking started from.
        any_sex: whether the template of the other sex is tried as well; the more probable body of
            both is taken.
    """
    covariance = start.covariance
    if covariance is None:
        return
    frames = clear_frames(tracker, _FRAMES)
    observations = [frame.observation for frame in frames.values()]
    poses = [pose for t in frames if (pose := tracker.poses[t]) is not None]
    voxel_size_m = tracker.observations.observer.voxel_size_m
    backend, own = tracker.body.body_volume.backend, tracker.body.model
    templates = [(tracker.body.surface, start.expected_shape)]
    if any_sex:
        other = replace(own.sizes, sex=_OTHER_SEX[own.sizes.sex])
        templates.append(shaped_template(other, own.shape))

    def adapted(template: tuple[Surface, np.ndarray]) -> AdaptedBody:
        moved = [with_joints_of(template[0].model, own, pose) for pose in poses]
        prior = template[1], covariance
        return adapted_to(template[0], prior, observations, moved, start.stature, backend)

    best = min(side_by_side(adapted, templates), key=lambda one: one.cost)
    tracker.body = BodyGeometry.from_surface(best.surface, voxel_size_m, backend)
    if best.surface.model.sizes.sex != own.sizes.sex:
        tracker.poses = [
            None if pose is None else with_joints_of(best.surface.model, own, pose)
            for pose in tracker.poses
        ]


def shaped_template(sizes: BodySizes, shape: np.ndarray) -> tuple[Surface, np.ndarray]:
    """Surface of the template of some sizes with deviations (K,), and the deviations (K,) that the
    sizes alone suggest.
    """
    template = BodyModel.from_sizes(sizes)
    return Surface(template.reshaped(shape), taken=sampled_vertices(sizes.sex)), template.shape


def adapted_to(
    surface: Surface,
    prior: tuple[np.ndarray, np.ndarray],
    observations: list[Observation],
    poses: list[Pose],
    stature: Stature,
    backend: Backend,
) -> AdaptedBody:
    """Adapts a body to frames, and says how probable it is.

    Args:
        surface: of the initial body.
        prior: (K,) mean and (K, K) covariance of its deviations.
        observations: the frames.
        poses: of each.
        stature: the person's height.
        backend: measures the silhouette errors.
    """
    expected, covariance = prior
    surface, poses = adapt_shape(surface, observations, poses, stature, expected, covariance)
    errors = [
        silhouette_error(surface.model, pose, observation, backend)
        for pose, observation in zip(poses, observations, strict=True)
    ]
    error, deviation = float(np.mean(errors)), surface.model.shape - expected
    unusual = 0.5 * float(deviation @ np.linalg.solve(covariance, deviation))
    unusual -= float(np.log(sex_probability(surface.model.sizes.sex, stature_of(surface.model))))
    return AdaptedBody(surface, poses, error, _INDEPENDENT * float(np.log(error)) + unusual)


def with_joints_of(model: BodyModel, other: BodyModel, pose: Pose) -> Pose:
    """A pose of another body with the root where a body has it whose neck is in the same place."""
    higher = (other.landmarks_m[_NECK] - other.joints_m[0]) - (
        model.landmarks_m[_NECK] - model.joints_m[0]
    )
    return Pose(pose.root_m + pose.root_rotation @ higher, pose.root_rotation, pose.angles_rad)
