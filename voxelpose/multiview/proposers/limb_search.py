"""Search for a whole limb on the silhouettes, where the voxels of a thin arm are missing.

One camera that errs by a few pixels carves a forearm away, but the other cameras still show it. The
rest of the body stays, and an arm or a leg is placed (both its parts, over the whole range of its
joints) where it explains most of the silhouettes that the rest of the body does not. Beyond paper
B: part by part along the body tree, but scored on the images.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.limbs import (
    Limb,
    sample_angles,
    sample_grid,
    sample_hinge,
    within_limits,
)
from voxelpose.multiview.tuning import MATCHING

_UNEXPLAINED, _EXPLAINED, _OUTSIDE = 2, 0, -3
_FINALISTS = 12


def place_limb(
    body_volume: BodyVolume,
    observation: Observation,
    pose: Pose,
    chain: tuple[Limb, ...],
    apart_m: float = 0.0,
) -> Pose:
    """Pose with one arm, leg or other chain where it explains most of what the rest does not.

    Args:
        apart_m: least distance from where the middle of the chain's last limb is now.
    """
    upper, tree = chain[0], body_volume.model.tree
    step_rad = np.radians(MATCHING.step_deg)
    covering = _Covering(body_volume, observation)
    searched = tuple(limb for limb in body_volume.limbs if _carried(limb, upper, body_volume.limbs))
    images = covering.explained(_pixel_values(observation), pose, searched, rest=True)
    above = sample_angles(upper, pose.angles_rad, step_rad, tree)
    first = _scores(body_volume, observation, images, upper, pose, above)
    if len(chain) == 1:
        first = np.where(_moved_m(body_volume, upper, pose, above) < apart_m, -np.inf, first)
        return Pose(pose.root_m, pose.root_rotation, above[int(first.argmax())])
    lower = chain[1]
    # The upper part alone rules out most of the range.
    likely = np.argsort(-first, kind="stable")[: max(len(first) // 2, 1)]
    above, first = above[likely], first[likely]
    sample_below = sample_grid if lower.angles else sample_hinge
    below = sample_below(lower, above, step_rad, tree)
    possible = within_limits(below, tree)
    possible[possible] = _moved_m(body_volume, lower, pose, below[possible]) >= apart_m
    second = np.full(below.shape[:2], -np.inf)
    second[possible] = _scores(body_volume, observation, images, lower, pose, below[possible])
    bound = first + second.max(1)
    best, result = -np.inf, pose
    # Folded onto the upper part, the lower one would count the same pixels again: the likeliest
    # placements are scored again without those.
    for k in np.argsort(-bound, kind="stable")[:_FINALISTS]:
        if bound[k] <= best or not np.isfinite(bound[k]):
            break
        placed, bent = Pose(pose.root_m, pose.root_rotation, above[k]), below[k, possible[k]]
        left = covering.explained(images, placed, (upper,), rest=False)
        rest = _scores(body_volume, observation, left, lower, pose, bent)
        m = int(rest.argmax())
        if first[k] + rest[m] > best:
            best, result = first[k] + rest[m], Pose(pose.root_m, pose.root_rotation, bent[m])
    return result


def _moved_m(body_volume: BodyVolume, limb: Limb, pose: Pose, angles: np.ndarray) -> np.ndarray:
    """How far (K,) placements move a limb's middle from where a pose has it, m."""
    every = np.concatenate([pose.angles_rad[None], angles])
    rotations, origins = body_volume.placements(limb, pose, every)
    middles = rotations @ body_volume.points[limb.name].mean(axis=0) + origins
    return np.linalg.norm(middles[1:] - middles[0], axis=1)


def _carried(limb: Limb | None, upper: Limb, limbs: Sequence[Limb]) -> bool:
    """Whether a limb is another one or is carried by it."""
    while limb is not None and limb.name != upper.name:
        limb = next((one for one in limbs if one.name == limb.carried_by), None)
    return limb is not None


def _pixel_values(observation: Observation) -> np.ndarray:
    """Value (C, h, w) int8 of each pixel for a limb, if no part covers it; 0 if unknown."""
    masks, unknown = observation.masks, observation.views.unknown
    height, width = (max(mask.shape[axis] for mask in masks) for axis in (0, 1))
    images = np.zeros((len(masks), height, width), np.int8)
    for image, mask in zip(images, masks, strict=True):
        inside = mask.view(np.int8) * np.int8(_UNEXPLAINED - _OUTSIDE)
        np.add(inside, np.int8(_OUTSIDE), out=image[: mask.shape[0], : mask.shape[1]])
    for image, where in zip(images, unknown or (), strict=unknown is not None):
        image[: where.shape[0], : where.shape[1]][where] = _EXPLAINED
    return images


class _Covering:
    """Draws parts of a body into all views of a frame at once, where the silhouettes are."""

    def __init__(self, body_volume: BodyVolume, observation: Observation):
        views = observation.views
        matrices = np.stack([camera.matrix for camera in views.rig])
        self._model, self._backend = body_volume.model, body_volume.backend
        boxes = np.array([cv2.boundingRect(mask.view(np.uint8)) for mask in observation.masks])
        self._corners = boxes[:, :2]
        width, height = np.maximum(boxes[:, 2:].max(0), 1)
        self._size = int(width), int(height)
        matrices[:, :2] -= self._corners[:, :, None] * matrices[:, 2:]
        # Pixel positions times depth: all cameras are drawn by the same matrix.
        self._turn = views.rotation.transpose(0, 2, 1) @ matrices.transpose(0, 2, 1)
        self._shift = np.einsum("ci,cji->cj", views.translation_m, matrices)[:, None]

    def explained(
        self, images: np.ndarray, pose: Pose, limbs: tuple[Limb, ...], rest: bool
    ) -> np.ndarray:
        """Pixel values (C, h, w) int8 of which those that parts of the body cover are explained.

        Args:
            images: (C, h, w) int8, values so far; outside of the silhouettes they stay.
            limbs: whose parts are drawn.
            rest: all parts but those are drawn instead.
        """
        model = self._model
        parts = [model.names.index(name) for limb in limbs for name in limb.parts]
        drawn = np.isin(model.face_part, parts) != rest
        meshes = posed_mesh(model, pose) @ self._turn + self._shift
        # An opened body shows its inside: both sides of the faces are drawn.
        faces, face_part = model.faces[drawn], model.face_part[drawn]
        covered = self._backend.part_images(
            meshes, faces, face_part, np.eye(3), self._size, cull_back=False
        )
        images = images.copy()
        for image, cover, (left, top) in zip(images, covered, self._corners, strict=True):
            window = image[top : top + cover.shape[0], left : left + cover.shape[1]]
            cover = cover[: window.shape[0], : window.shape[1]]
            window[(cover > 0) & (window > _EXPLAINED)] = _EXPLAINED
        return images


def _scores(
    body_volume: BodyVolume,
    observation: Observation,
    images: np.ndarray,
    limb: Limb,
    pose: Pose,
    angles: np.ndarray,
) -> np.ndarray:
    """Scores (K,) of a limb's placements, per volume the same for all limbs."""
    points, volume = body_volume.few_points[limb.name]
    return volume * body_volume.backend.pixel_scores(
        observation.views, images, points, *body_volume.placements(limb, pose, angles)
    )
