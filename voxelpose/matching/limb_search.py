"""A whole limb looked for on the silhouettes, where the voxels of a thin arm are missing from the
hull.

One camera that errs by a few pixels carves a forearm away, but the other cameras still show it.
Here the rest of the body stays, and an arm or a leg is placed (both its parts, over the whole range
of its joints) where it explains most of what the silhouettes show and the
rest of the body does not. Beyond paper B: part by part along the body tree, but judged on the
pictures.
"""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.pose import Pose
from silhouette_core.refinement.silhouette_error import posed_mesh
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.kernels.limb_scores import score_placements
from voxelpose.matching.limbs import LIMBS, Limb, sample_angles, sample_hinge, within_limits

CHAINS = tuple(
    (
        next(limb for limb in LIMBS if limb.name == f"{side}_{upper}"),
        next(limb for limb in LIMBS if limb.name == f"{side}_{lower}"),
    )
    for upper, lower in (("upper_arm", "forearm"), ("thigh", "shin"))
    for side in ("left", "right")
)
"""The arms and the legs, each from its upper to its lower part."""

_STEP_RAD = np.radians(15.0)
_UNEXPLAINED, _EXPLAINED, _OUTSIDE = 2, 0, -3
_POINTS = 60
_FINALISTS = 12


def place_limb(
    body_volume: BodyVolume,
    observation: Observation,
    pose: Pose,
    chain: tuple[Limb, Limb],
    around_rad: float | None = None,
) -> Pose:
    """Places one arm or leg where it explains most of the silhouettes that the rest of the body
    leaves.

    Args:
        body_volume: the body.
        observation: the frame.
        pose: everything but the limb is taken from it.
        chain: upper and lower part.
        around_rad: searches at most this far from `pose`; None: the whole range.
    """
    upper, lower = chain
    worth = _worth(body_volume.model, observation, pose, chain)
    above = sample_angles(upper, pose.angles_rad, _STEP_RAD, around_rad)
    first = _scores(body_volume, observation, worth, upper, pose, above)
    below = sample_hinge(lower, above, _STEP_RAD, around_rad)
    possible = within_limits(below)
    second = _scores(
        body_volume, observation, worth, lower, pose, below.reshape(-1, below.shape[-1])
    ).reshape(below.shape[:2])
    hoped = first + np.where(possible, second, -np.inf).max(1)
    best, answer = -np.inf, pose
    # Folded onto the upper part, the lower one would be paid for the same pixels: the likeliest are
    # judged again without those.
    for k in np.argsort(-hoped, kind="stable")[:_FINALISTS]:
        if not np.isfinite(hoped[k]):
            break
        placed = Pose(pose.root_m, pose.root_rotation, above[k])
        left = _scores(
            body_volume,
            observation,
            _worth(body_volume.model, observation, placed, (lower,)),
            lower,
            pose,
            below[k],
        )
        m = int(np.where(possible[k], left, -np.inf).argmax())
        if first[k] + left[m] > best:
            best, answer = first[k] + left[m], Pose(pose.root_m, pose.root_rotation, below[k, m])
    return answer


def _worth(
    model: BodyModel, observation: Observation, pose: Pose, limbs: tuple[Limb, ...]
) -> np.ndarray:
    """(C, h, w) int8: what a pixel counts for limbs that are to be placed."""
    free = [model.names.index(name) for part in limbs for name in part.parts]
    kept = ~np.isin(model.face_part, free)
    faces, face_part = model.faces[kept], model.face_part[kept]
    vertices = posed_mesh(model, pose)
    views = observation.views
    height, width = (max(mask.shape[axis] for mask in observation.masks) for axis in (0, 1))
    worth = np.zeros((len(observation.masks), height, width), np.int8)
    for c, mask in enumerate(observation.masks):
        in_camera = vertices @ views.rotation[c].T + views.translation_m[c]
        rest, _ = render_parts(
            in_camera, faces, face_part, views.rig.cameras[c].matrix, views.rig.cameras[c].size
        )
        worth[c, : mask.shape[0], : mask.shape[1]] = np.where(
            mask, np.where(rest > 0, _EXPLAINED, _UNEXPLAINED), _OUTSIDE
        )
    return worth


def _scores(
    body_volume: BodyVolume,
    observation: Observation,
    worth: np.ndarray,
    limb: Limb,
    pose: Pose,
    angles: np.ndarray,
) -> np.ndarray:
    """(K,) worth of a limb's placements, per cubic metre of its volume alike for all limbs."""
    points = body_volume.points[limb.name]
    step = max(len(points) // _POINTS, 1)
    rotations, translations = body_volume.placements(limb, pose, angles)
    views = observation.views
    scores = np.empty(len(angles), np.int64)
    score_placements(
        points[::step],
        rotations,
        translations,
        views.intrinsics,
        views.rotation,
        views.translation_m,
        worth,
        scores,
    )
    return scores * float(step)
