"""Silhouettes of one frame prepared for refinement: distance images, and contour points with the
planes that touch the body there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from calib.camera import Rig
from silhouette_core.tuning import REFINEMENT

_BORDER_PX = 2  # contour points this near the image border bound the view, not the body
_TANGENT_PX = 4  # half length of the contour piece whose direction is taken as the tangent
_UNKNOWN_PX = _BORDER_PX + _TANGENT_PX  # contour points this near to what is unknown


@dataclass(frozen=True, eq=False)
class PinholeViews:
    """Cameras without distortion, as plain arrays for kernels. C cameras."""

    rig: Rig
    intrinsics: np.ndarray  #: (C, 4) float64, fx, fy, cx, cy in px.
    rotation: np.ndarray  #: (C, 3, 3) float64, camera from world.
    translation_m: np.ndarray  #: (C, 3) float64, camera from world.
    center_m: np.ndarray  #: (C, 3) float64, world positions of the cameras.
    unknown: tuple[np.ndarray, ...] | None = None
    """C arrays (h, w) bool, pixels about which nothing is known, where silhouettes are empty; None:
    there are none."""

    @classmethod
    def from_rig(cls, rig: Rig, unknown: Sequence[np.ndarray] | None = None) -> "PinholeViews":
        """Packs the pinhole cameras of a rig (`Camera.pinhole`), with what is unknown in each."""
        matrices = np.stack([camera.matrix for camera in rig])
        return cls(
            rig,
            np.stack(
                [matrices[:, 0, 0], matrices[:, 1, 1], matrices[:, 0, 2], matrices[:, 1, 2]], 1
            ),
            np.stack([camera.rotation for camera in rig]),
            np.stack([camera.translation for camera in rig]),
            np.stack([camera.center_m for camera in rig]),
            None if unknown is None else tuple(unknown),
        )

    @property
    def partly_unknown(self) -> int:
        """Number of cameras in which something is unknown."""
        return sum(bool(mask.any()) for mask in self.unknown or ())

    def without_unknown(self, masks: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Masks (h, w) bool, one per camera, that are empty where nothing is known."""
        if self.unknown is None:
            return list(masks)
        return [mask & ~unknown for mask, unknown in zip(masks, self.unknown, strict=True)]


@dataclass(frozen=True, eq=False)
class Observation:
    """One frame's silhouettes in C pinhole views, with N contour points.

    A contour point's viewing ray and its tangent span a plane that touches the body from outside.
    """

    views: PinholeViews
    masks: tuple[np.ndarray, ...]  #: C arrays (h, w) bool.
    outside_px: tuple[np.ndarray, ...]
    """C arrays (h, w) float32, distance to the silhouette and to what is unknown, see
    `outside_distances`."""
    camera: np.ndarray  #: (N,) int32, the camera of each contour point.
    ray: np.ndarray  #: (N, 3) float64, unit viewing directions in the world.
    normal: np.ndarray  #: (N, 3) float64, unit normals of the tangent planes, away from the body.

    @classmethod
    def from_masks(
        cls, views: PinholeViews, masks: list[np.ndarray], distance_m: float = 4.0
    ) -> "Observation":
        """Prepares the silhouettes of one frame.

        Args:
            masks: C silhouettes (h, w) bool, as the cameras' images.
            distance_m: typical distance of the body from the cameras, to space the contour points.
        """
        cameras, rays, normals, outside = [], [], [], []
        for c, mask in enumerate(masks):
            step = max(round(REFINEMENT.spacing_m * views.intrinsics[c, 0] / distance_m), 1)
            unknown = None if views.unknown is None else views.unknown[c]
            pixels, directions = contour_points(mask, step, unknown)
            ray, normal = _tangent_planes(views, c, pixels, directions)
            cameras.append(np.full(len(ray), c, np.int32))
            rays.append(ray)
            normals.append(normal)
            possible = mask if unknown is None else mask | unknown
            outside.append(outside_distances(possible))
        return cls(
            views,
            tuple(masks),
            tuple(outside),
            np.concatenate(cameras),
            np.concatenate(rays),
            np.concatenate(normals),
        )


def outside_distances(mask: np.ndarray) -> np.ndarray:
    """Distance (h, w) float32 of every pixel from a silhouette (h, w) bool, px; 0 inside.

    Beyond a margin about the silhouette, a fraction of its longer side, it stays what it is there:
    a surface point so far away weighs next to nothing.
    """
    outside = (~mask).view(np.uint8)
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    if not width:
        return cv2.distanceTransform(outside, cv2.DIST_L2, cv2.DIST_MASK_5)
    around = int(REFINEMENT.margin * max(width, height))
    right, bottom = min(left + width + around, mask.shape[1]), min(top + height + around, len(mask))
    left, top = max(left - around, 0), max(top - around, 0)
    near = cv2.distanceTransform(
        np.ascontiguousarray(outside[top:bottom, left:right]), cv2.DIST_L2, cv2.DIST_MASK_5
    )
    below, beside = len(mask) - bottom, mask.shape[1] - right
    return cv2.copyMakeBorder(near, top, below, left, beside, cv2.BORDER_REPLICATE)


def contour_points(
    mask: np.ndarray, step: int, unknown: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Points on a silhouette's edge, with the direction that leads out of it.

    Args:
        mask: (h, w) bool.
        step: pixels of contour between points.
        unknown: (h, w) bool, where nothing is known; None: nowhere.

    Returns:
        Positions (N, 2) float64, px, on the edge between inside and outside, and unit outward
        directions (N, 2) float64. There are none where the image border cuts the silhouette, nor
        where something unknown does.
    """
    height, width = mask.shape
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    positions, outward = [np.empty((0, 2))], [np.empty((0, 2))]
    near = None if unknown is None else _around(unknown)
    for contour in contours:
        points = contour[:, 0].astype(float)
        if len(points) < 4 * _TANGENT_PX:
            continue
        tangent = np.roll(points, -_TANGENT_PX, 0) - np.roll(points, _TANGENT_PX, 0)
        keep = np.arange(0, len(points), step)
        tangent, points = tangent[keep], points[keep]
        length = np.linalg.norm(tangent, axis=1, keepdims=True)
        # OpenCV orders outer contours and holes so that the inside is always on the same side.
        normal = np.stack([tangent[:, 1], -tangent[:, 0]], 1) / np.maximum(length, 1e-9)
        inner = np.all(
            (points >= _BORDER_PX) & (points < (width - _BORDER_PX, height - _BORDER_PX)), axis=1
        ) & (length[:, 0] > 1e-9)
        before, after = (_on_mask(mask, points + side * normal) for side in (-1.5, 1.5))
        normal[after & ~before] *= -1
        good = inner & (before ^ after)
        if near is not None:
            good &= ~_on_mask(near, points)
        # A contour pixel belongs to the inside; the edge is half a pixel farther out.
        positions.append((points + 0.5 * normal)[good])
        outward.append(normal[good])
    return np.concatenate(positions), np.concatenate(outward)


def _around(unknown: np.ndarray) -> np.ndarray:
    """Pixels (h, w) bool so near to what is unknown that it bounds the silhouette there."""
    square = np.ones((2 * _UNKNOWN_PX + 1, 2 * _UNKNOWN_PX + 1), np.uint8)
    return np.asarray(cv2.dilate(unknown.view(np.uint8), square), np.uint8).view(np.bool_)


def _on_mask(mask: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N,) bool: whether the pixels nearest to points (N, 2) belong to the mask."""
    column = np.clip(np.rint(points[:, 0]).astype(int), 0, mask.shape[1] - 1)
    row = np.clip(np.rint(points[:, 1]).astype(int), 0, mask.shape[0] - 1)
    return mask[row, column]


def _tangent_planes(
    views: PinholeViews, c: int, pixels: np.ndarray, outward: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Viewing rays and plane normals (N, 3), unit, world, of contour points (N, 2) of camera c."""
    fx, fy, cx, cy = views.intrinsics[c]
    ray = np.stack([(pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy, np.ones(len(pixels))], 1)
    tangent = np.stack([-outward[:, 1] / fx, outward[:, 0] / fy, np.zeros(len(pixels))], 1)
    outward_px = np.stack([outward[:, 0] / fx, outward[:, 1] / fy, np.zeros(len(pixels))], 1)
    normal = np.cross(ray, tangent)
    normal *= np.sign((normal * outward_px).sum(1, keepdims=True))
    unit = lambda v: v / np.linalg.norm(v, axis=1, keepdims=True)  # noqa: E731
    return unit(ray) @ views.rotation[c], unit(normal) @ views.rotation[c]
