"""Search for a root that stands still, in several frames of one camera together.

Each frame by itself leaves open where the root is and which way it faces: the depth is weak, and a
joint that turns about the vertical makes up for any heading. All frames have the same root.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calib.camera import Camera, Rig
from calib.checks import BoolArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.tree.descent import Posterior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import yaw_rotations
from silhouette_core.monocular.tree.sample_proposer import find_samples
from silhouette_core.monocular.tuning import ROOT_SEARCH
from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import rounded
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.posterior import still_root
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.silhouette_error import mask_errors
from silhouette_core.tuning import REFINEMENT

_STARTS = RefineSettings(reaches_m=(ROOT_SEARCH.first_reach_m, *REFINEMENT.near_reaches_m))
_HELD = RefineSettings(reaches_m=REFINEMENT.near_reaches_m)
_OF_EACH_VIEW = 2  # poses refined of every view of a frame
_LIKELY = 10  # poses of a frame that are tried with a root
_ROOTS, _ROUNDS = 5, 2
_HEADINGS, _HEADINGS_TRIED, _OF_EACH_HEADING = 24, 3, 2


@dataclass(frozen=True, eq=False)
class _Frame:
    """A frame: what it shows, and refined poses (K) with their silhouette errors (K,)."""

    observation: Observation
    poses: list[Pose]
    errors: FloatArray


def find_root(
    library: PoseLibrary, camera: Camera, masks: Sequence[BoolArray], backend: Backend
) -> Pose:
    """Placement of a root that stands still.

    The best poses of every frame and view are refined with their roots free. A root that is near to
    one of the good poses of every frame is likely; with the likeliest, all frames are refined again
    while it is held, and the one with the smallest errors remains. Last, it is turned to all other
    headings.

    Args:
        library: of the body, from all sides.
        camera: pinhole camera without distortion.
        masks: silhouettes (h, w) bool of some frames, not empty.

    Returns:
        The root, with the joint angles of one of the frames.
    """
    model = library.model
    surface, views = Surface(model, 500), PinholeViews.from_rig(Rig((camera,)))
    frames = [
        _refined(find_samples(library, camera, mask, backend), views, surface, mask, backend)
        for mask in masks
    ]
    settled = [_settled(surface, frames, root, backend) for root in _likely_roots(frames)]
    best = min(settled, key=_error)
    turned = [
        [_turned(frame, turn, model) for frame in best[1]]
        for turn in yaw_rotations(np.arange(1, _HEADINGS) * 2 * np.pi / _HEADINGS)
    ]
    others = [
        (
            frames[0].poses[0],
            [_held(surface, frame, frames[0].poses[0], backend) for frame in frames],
        )
        for frames in turned
    ]
    likely = sorted(others, key=_error)[:_HEADINGS_TRIED]
    settled = [_settled(surface, frames, frames[0].poses[0], backend) for _, frames in likely]
    return min([best, *settled], key=_error)[0]


def _error(placed: tuple[Pose, list[_Frame]]) -> float:
    """Mean over frames of the error of the best pose with a root."""
    return float(rounded(np.mean([frame.errors.min() for frame in placed[1]])))


def _settled(
    surface: Surface, frames: Sequence[_Frame], root: Pose, backend: Backend
) -> tuple[Pose, list[_Frame]]:
    """A root placed by all frames together, and their poses with it."""
    for _ in range(_ROUNDS):
        held = [_held(surface, frame, root, backend) for frame in frames]
        best = [frame.poses[int(frame.errors.argmin())] for frame in held]
        root = still_root(surface, [frame.observation for frame in frames], best, _HELD)
    return root, [_held(surface, frame, root, backend) for frame in frames]


def _turned(frame: _Frame, turn: FloatArray, model: BodyModel) -> _Frame:
    """The best poses of a frame with the root turned in the world.

    Joints at the root make up for the turn as far as they can: what they carry stays where it is,
    and only the root itself tells the right heading.
    """
    best = np.argsort(frame.errors, kind="stable")[:_OF_EACH_HEADING]
    poses = [_root_turned(frame.poses[k], turn, model) for k in best]
    return _Frame(frame.observation, poses, frame.errors[best])


def _root_turned(pose: Pose, turn: FloatArray, model: BodyModel) -> Pose:
    angles = pose.angles_rad.copy()
    back = Rotation.from_matrix(pose.root_rotation.T @ turn.T @ pose.root_rotation)
    for part in np.flatnonzero(model.tree.parents == 0):
        dofs = np.flatnonzero(model.tree.dof_part == part)
        axes = model.tree.dof_axis[dofs]
        wanted = (back * Rotation.from_rotvec(angles[dofs] @ axes)).as_rotvec()
        angles[dofs] = np.linalg.lstsq(axes.T, wanted, rcond=None)[0]
    return Pose(pose.root_m, turn @ pose.root_rotation, angles).clipped(model.tree.dof_limits_rad)


def _refined(
    posterior: Posterior, views: PinholeViews, surface: Surface, mask: BoolArray, backend: Backend
) -> _Frame:
    """The best poses of every view, refined with the root free."""
    poses, distance_m = posterior.poses(_best_of_views(posterior)).poses(), posterior.distance_m
    observation = Observation.from_masks(views, [mask], distance_m)
    return _fitted(backend, surface, observation, poses, _STARTS, 3, 0.1 * distance_m)


def _fitted(
    backend: Backend,
    surface: Surface,
    observation: Observation,
    poses: Sequence[Pose],
    refining: RefineSettings,
    count: int,
    sigma_m: float,
) -> _Frame:
    """A frame with poses that are refined; the first `count` numbers of a pose have the deviation
    `sigma_m`, m or radians.
    """
    sigma = np.full(6 + surface.model.dof_count, ROOT_SEARCH.loose_rad)
    sigma[:count] = sigma_m
    starts = [RefineStart(pose, refining, PosePrior(pose, sigma)) for pose in poses]
    refined = [one.pose for one in refine_many(surface, observation, starts)]
    errors = mask_errors(surface.model, refined, observation.views, observation.masks, backend)
    return _Frame(observation, refined, errors)


def _best_of_views(posterior: Posterior) -> list[int]:
    views = posterior.library.sample_view[posterior.samples]
    return [
        row
        for view in range(len(posterior.library.views))
        for row in np.flatnonzero(views == view)[:_OF_EACH_VIEW].tolist()
    ]


def _gaps(poses: Sequence[Pose], root: Pose) -> FloatArray:
    """Squared distances (K,) of the roots of poses from a root, in standard deviations."""
    moved = np.array([pose.root_m - root.root_m for pose in poses])
    turns = np.stack([pose.root_rotation for pose in poses]) @ root.root_rotation.T
    turned = Rotation.from_matrix(turns).magnitude()
    return (moved**2).sum(1) / ROOT_SEARCH.sigma_m**2 + turned**2 / np.radians(
        ROOT_SEARCH.sigma_deg
    ) ** 2


def _costs(frame: _Frame, root: Pose) -> FloatArray:
    """Costs (K,) of a frame's poses with a root, in squared standard deviations."""
    errors = (frame.errors / ROOT_SEARCH.sigma_error) ** 2
    return np.minimum(_gaps(frame.poses, root), 50.0) + errors


def _likely_roots(frames: Sequence[_Frame]) -> list[Pose]:
    """Roots to which all frames have a good pose near, the likeliest first, no two alike."""
    roots = [pose for frame in frames for pose in frame.poses]
    costs = rounded([sum(_costs(frame, root).min() for frame in frames) for root in roots])
    chosen: list[Pose] = []
    for k in np.argsort(costs, kind="stable"):
        if len(chosen) < _ROOTS and (not chosen or _gaps(chosen, roots[k]).min() > 2.0):
            chosen.append(roots[k])
    return chosen


def _held(surface: Surface, frame: _Frame, root: Pose, backend: Backend) -> _Frame:
    """The likeliest poses of a frame, refined with a root that is held."""
    likely = rounded(_costs(frame, root))
    poses = [
        Pose(root.root_m, root.root_rotation, frame.poses[k].angles_rad)
        for k in np.argsort(likely, kind="stable")[:_LIKELY]
    ]
    return _fitted(backend, surface, frame.observation, poses, _HELD, 6, 1e-5)
