"""A body and its latest poses, and the step to its pose in the next frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from silhouette_core.motion.dynamics import FPS, MOMENTUM, pose_step_sigma
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit, refine_fit

Masks = Mapping[str, NDArray[np.bool_]]

STEP = RefineSettings(reaches_m=(0.18, 0.12, 0.08, 0.06))
_AGAIN = RefineSettings(reaches_m=(0.30, 0.20, 0.15, 0.10, 0.07, 0.06))
_LONG, _LONGEST = 2.5, 6.0  # in units of 1 / FPS: a long time between frames, and the longest
_POOR, _POOR_BY = 1.2, 0.01  # factor, and excess, over the usual error that make a frame poor
_MARGIN = 0.25  # about a silhouette, see `outside_distances`
_SPACING_M = 0.05  # between contour points: half as many as off line
_RECENT = 12  # frames whose median error is the usual one
_NEAR_M, _REDUCED = 0.30, 8


@dataclass(frozen=True, eq=False)
class Moment:
    """Silhouettes of one moment, packed.

    Attributes:
        time_s: of the moment.
        bits: by camera name, (h, ceil(w / 8)) uint8 and the width w.
    """

    time_s: float
    bits: dict[str, tuple[NDArray[np.uint8], int]]

    @classmethod
    def of(cls, time_s: float, masks: Masks) -> Moment:
        """Packs silhouettes (h, w) bool by camera name."""
        packed = {name: (np.packbits(mask, axis=1), mask.shape[1]) for name, mask in masks.items()}
        return cls(time_s, packed)

    def masks(self) -> dict[str, NDArray[np.bool_]]:
        """Silhouettes (h, w) bool by camera name."""
        return {
            name: np.unpackbits(bits, axis=1, count=width).view(bool)
            for name, (bits, width) in self.bits.items()
        }


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """A body and its latest poses.

    Attributes:
        body: the body.
        time_s: of the latest frame.
        fit: its pose and error.
        before: time and pose of the frame before it.
        errors: of recent frames.
    """

    body: BodyGeometry
    time_s: float
    fit: PoseFit
    before: tuple[float, Pose] | None = None
    errors: tuple[float, ...] = ()

    @property
    def usual(self) -> float:
        """Median error of recent frames."""
        return float(np.median(self.errors)) if self.errors else self.fit.error

    def predicted(self, time_s: float) -> Pose:
        """Pose expected at a damped constant velocity."""
        if self.before is None:
            return self.fit.pose
        before_s, before = self.before
        ahead = MOMENTUM * (time_s - self.time_s) / max(self.time_s - before_s, 1e-3)
        ahead_pose = self.fit.pose.moved(min(ahead, 3.0) * self.fit.pose.minus(before))
        return ahead_pose.clipped(self.body.model.dof_limits_rad)

    def step(
        self, rig: Rig, time_s: float, masks: Masks, settings: RefineSettings = STEP
    ) -> BodyTrack:
        """Track with the next frame.

        Args:
            rig: pinhole cameras.
            time_s: time of the frame.
            masks: silhouettes (h, w) bool by camera name.
            settings: of the refinement.
        """
        views, predicted = views_of(rig, tuple(masks)), self.predicted(time_s)
        interval = float(np.clip((time_s - self.time_s) * FPS, 0.3, _LONGEST))
        if interval > _LONG:
            settings = _AGAIN
        observation = observed_near(self.body, views, masks, predicted)
        sigma = pose_step_sigma(self.body.model.tree) * interval
        prior = PosePrior(predicted, sigma)
        fit = refine_fit(self.body, observation, predicted, prior, settings)
        if fit.error > _POOR * self.usual + _POOR_BY:
            # It moved farther than expected, or otherwise: from the last pose, with longer reaches.
            prior = PosePrior(self.fit.pose, 3 * sigma)
            again = refine_fit(self.body, observation, self.fit.pose, prior, _AGAIN)
            fit = min(fit, again, key=lambda one: one.error)
        errors = (*self.errors[1 - _RECENT :], fit.error)
        return BodyTrack(self.body, time_s, fit, (self.time_s, self.fit.pose), errors)


@lru_cache(maxsize=64)
def views_of(rig: Rig, names: tuple[str, ...]) -> PinholeViews:
    """Some of a rig's cameras, packed."""
    return PinholeViews.from_rig(rig.select(list(names)))


def observed_near(body: BodyGeometry, views: PinholeViews, masks: Masks, pose: Pose) -> Observation:
    """Silhouettes without what is farther from a pose than a limb moves in a few frames.

    Args:
        body: the body.
        views: C pinhole cameras.
        masks: C silhouettes (h, w) bool by camera name, in the order of the views.
        pose: near which the silhouettes count.
    """
    points = body.surface.posed(pose).points[::4]
    near = []
    for c, mask in enumerate(masks.values()):
        inside = points @ views.rotation[c].T + views.translation_m[c]
        depth = np.maximum(inside[:, 2], 0.1)
        focal, center = views.intrinsics[c, :2], views.intrinsics[c, 2:]
        height, width = mask.shape
        small = np.zeros((-(-height // _REDUCED), -(-width // _REDUCED)), np.uint8)
        pixels = (inside[:, :2] / depth[:, None] * focal + center) / _REDUCED
        x, y = np.clip(pixels, 0, np.array(small.shape[::-1]) - 1).astype(int).T
        small[y, x] = 1
        reach = max(round(_NEAR_M * focal[0] / float(np.median(depth)) / _REDUCED), 1)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        size = small.shape[1] * _REDUCED, small.shape[0] * _REDUCED
        whole = cv2.resize(cv2.dilate(small, disc), size, interpolation=cv2.INTER_NEAREST)
        near.append(mask & whole[:height, :width].view(bool))
    return observation_at(views, near, pose.root_m)


def observation_at(
    views: PinholeViews, masks: list[NDArray[np.bool_]], place_m: NDArray[np.float64]
) -> Observation:
    """Silhouettes (h, w) bool of C views, with the contour points that a body at a place needs."""
    distance = float(np.median(np.linalg.norm(views.center_m - place_m, axis=1)))
    return Observation.from_masks(views, masks, distance, _SPACING_M, _MARGIN)
