"""Limbs put where a pose leaves the silhouette uncovered.

Beyond paper A. Refinement moves a limb along the contour near it and cannot find one that stands
out elsewhere. Where part of the silhouette is far from the drawn body, a hand or a foot must be:
each limb that reaches there is tried, bent before and behind the picture's plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.monocular.tracking.observed_frame import ObservedFrame
from silhouette_core.monocular.tuning import LIMBS
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.joint_placement import held_joints, place_bodies
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.refine import RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

_LIMBS = np.array(
    [
        [LANDMARK_NAMES.index(f"{side}_{joint}") for joint in joints]
        for joints in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
        for side in ("left", "right")
    ]
)
_ENDS = 2  # hands and feet looked for in a pose
_TRIED = 2  # limbs tried for each
_REFINING = RefineSettings(REFINEMENT.near_reaches_m[:-1])


def reach_uncovered(
    surface: Surface,
    observed: ObservedFrame,
    poses: Sequence[Pose],
    priors: Sequence[LandmarkPrior],
) -> tuple[list[Pose], list[LandmarkPrior]]:
    """Poses with a limb where the given ones leave the silhouette uncovered, refined.

    Args:
        priors: K priors of their joints' positions.

    Returns:
        Poses, none if nothing stands out, and the priors that they were refined with: of the limb,
        a wrist or ankle on its viewing ray.
    """
    model, contour = surface.model, observed.contour
    if not poses:
        return [], []
    joints = joints_of(model, poses)
    drawn = observed.weights.part_images(model, poses) > 0
    starts: list[Pose] = []
    held: list[LandmarkPrior] = []
    wanted: list[LandmarkPrior] = []
    for pose, own, prior, covered in zip(poses, joints, priors, drawn, strict=True):
        for limb, aim, ray in _aims(observed, own, covered):
            starts.append(pose)
            held.append(
                _moved_end(
                    held_joints(own, LIMBS.placed_m),
                    limb,
                    aim - own[0],
                    _on_ray(ray),
                )
            )
            wanted.append(_moved_end(prior, limb, aim - prior.pelvis_m, _on_ray(ray)))
    if not starts:
        return [], []
    placed = place_bodies(surface, contour, held, starts)
    refined = refine_many(
        surface,
        contour,
        [RefineStart(one, _REFINING, None, own) for one, own in zip(placed, wanted, strict=True)],
    )
    return [one.pose for one in refined], wanted


def uncovered_ends(
    mask: NDArray[np.bool_], covered: NDArray[np.bool_], px_per_m: float
) -> list[NDArray[np.float64]]:
    """Where wrists or ankles should be, judged by what stands out of a drawn body.

    Args:
        mask: (h, w) bool, the silhouette.
        covered: (h, w) bool, the pixels of the drawn body, not empty.
        px_per_m: pixels per metre at the body.

    Returns:
        Points (2,), column and row, px, the farthest first.
    """
    away = cv2.distanceTransform((~covered).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    away[~mask] = 0.0
    # One limb is one region: it is not joined to another by a seam along the outline.
    regions = cv2.connectedComponents((away > LIMBS.least_m / 2 * px_per_m).view(np.uint8))[1]
    tips = [
        np.array(np.unravel_index(int(np.where(regions == k, away, 0.0).argmax()), away.shape))
        for k in range(1, int(regions.max()) + 1)
    ]
    tips = [tip for tip in tips if away[tuple(tip)] >= LIMBS.least_m * px_per_m]
    tips = sorted(tips, key=lambda tip: -away[tuple(tip)])[:_ENDS]
    body = np.argwhere(covered) if tips else np.empty((0, 2))
    ends: list[NDArray[np.float64]] = []
    for tip in tips:
        inward = body[np.square(body - tip).sum(axis=1).argmin()] - tip
        step = min(LIMBS.tip_m * px_per_m / float(np.linalg.norm(inward)), 1.0)
        ends.append((tip + step * inward)[::-1])
    return ends


def _aims(
    observed: ObservedFrame, joints: NDArray[np.float64], covered: NDArray[np.bool_]
) -> list[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]]:
    """Limbs (3,) to be moved, where in the world their ends should be, and the viewing rays."""
    weights = observed.weights
    in_camera = joints @ weights.rotation.T + weights.translation_m
    if not covered.any() or in_camera[0, 2] <= 0:
        return []
    center = -weights.rotation.T @ weights.translation_m
    projected = in_camera @ weights.matrix.T
    projected = projected[:, :2] / projected[:, 2:]
    px_per_m = float(weights.matrix[0, 0] / in_camera[0, 2])
    found = []
    for end in uncovered_ends(weights.mask, covered, px_per_m):
        gap_m = np.linalg.norm(projected[_LIMBS[:, 2]] - end, axis=1) / px_per_m
        if gap_m.min() < LIMBS.tip_m:
            continue
        ray = weights.rotation.T @ np.linalg.solve(weights.matrix, [*end, 1.0])
        ray /= np.linalg.norm(ray)
        for limb in _LIMBS[np.argsort(gap_m, kind="stable")[:_TRIED]]:
            found += [(limb, aim, ray) for aim in _within_reach(joints[limb], center, ray)]
    return found


def _within_reach(
    limb_m: NDArray[np.float64], center_m: NDArray[np.float64], ray: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Points on a ray that a limb with joints (3, 3) reaches, before its root and behind it, or
    comes nearest to.
    """
    length = float(np.linalg.norm(np.diff(limb_m, axis=0), axis=1).sum())
    nearest = center_m + ((limb_m[0] - center_m) @ ray) * ray
    apart = float(np.linalg.norm(nearest - limb_m[0]))
    half_way = 0.5 * np.sqrt(max(length**2 - apart**2, 0.0)) * ray
    return [nearest - half_way, nearest + half_way]


def _on_ray(ray: NDArray[np.float64]) -> NDArray[np.float64]:
    """Precision (3, 3), 1/m², of a point that is known to lie on a ray."""
    along = np.outer(ray, ray)
    return (np.eye(3) - along) / LIMBS.across_m**2 + along / LIMBS.along_m**2


def _moved_end(
    prior: LandmarkPrior,
    limb: NDArray[np.int64],
    end_m: NDArray[np.float64],
    precision: NDArray[np.float64],
) -> LandmarkPrior:
    """A prior with the end of a limb elsewhere, relative to the pelvis; its middle is free."""
    relative, precisions = prior.relative_m.copy(), prior.precision.copy()
    relative[limb[2]], precisions[limb[2]] = end_m, precision
    precisions[limb[1]] = 0.0
    return replace(prior, relative_m=relative, precision=precisions)
