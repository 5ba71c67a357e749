"""A body and its latest poses, and the step to its pose in the next frame: the same off line,
forward and backward, and live.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from calib.camera import Rig
from calib.checks import BoolArray, ByteArray, FloatArray
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.motion.dynamics import MOMENTUM, elapsed_steps, pose_step_sigma
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings
from silhouette_core.tuning import REFINEMENT
from voxelpose.multiview.carving.observe import observation_at
from voxelpose.multiview.person.posterior import is_unusual
from voxelpose.multiview.proposers.pose_search import (
    SEARCHED,
    BodyGeometry,
    PoseFit,
    move_limbs,
    refine_fit,
)
from voxelpose.multiview.tuning import TRACKING

Masks = Mapping[str, BoolArray]

RECENT = 12
"""Frames whose median error is the usual one: 0.4 s."""
_REDUCED = 8  # of the images in which the surroundings of a body are drawn


_Bits = dict[str, tuple[ByteArray, int]]


@dataclass(frozen=True, eq=False)
class Moment:
    """Silhouettes of one moment by camera, packed as (h, ceil(w / 8)) uint8 with the width w;
    `unknown`, where nothing is known of them, since others are there: None: nowhere.
    """

    time_s: float
    bits: _Bits
    unknown: _Bits | None = None

    @classmethod
    def of(cls, time_s: float, masks: Masks, unknown: Masks | None = None) -> "Moment":
        """Packs silhouettes, and what is unknown, (h, w) bool by camera name."""
        return cls(time_s, _packed(masks), None if unknown is None else _packed(unknown))

    def masks(self) -> dict[str, BoolArray]:
        """Silhouettes (h, w) bool by camera name."""
        return _unpacked(self.bits)

    def views(self, rig: Rig) -> PinholeViews:
        """The cameras of a rig that have silhouettes, with what is unknown in them."""
        views = views_of(rig, tuple(self.bits))
        if self.unknown is None:
            return views
        return replace(views, unknown=tuple(_unpacked(self.unknown).values()))


def _packed(masks: Masks) -> _Bits:
    return {name: (np.packbits(mask, axis=1), mask.shape[1]) for name, mask in masks.items()}


def _unpacked(bits: _Bits) -> dict[str, BoolArray]:
    return {
        name: np.unpackbits(rows, axis=1, count=width).view(bool)
        for name, (rows, width) in bits.items()
    }


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """A body and its latest poses, in the order in which they were tracked."""

    body: BodyGeometry
    time_s: float
    fit: PoseFit  #: its pose and error.
    before: tuple[float, Pose] | None = None  #: time and pose of the frame before it.
    errors: tuple[float, ...] = ()  #: of recent frames, the latest included.

    @property
    def usual(self) -> float:
        """Median error of recent frames."""
        return float(np.median(self.errors)) if self.errors else self.fit.error

    def is_poor(self, error: float) -> bool:
        """Whether an error is clearly larger than usual."""
        return is_unusual(error, self.usual)

    def predict(self, time_s: float) -> PosePrior:
        r"""Pose expected at a damped constant velocity, with the process noise of the time since.

        .. math:: \mu = x_k + 0.8 \, \frac{t - t_k}{t_k - t_{k-1}} (x_k - x_{k-1}), \qquad
            \sigma = |t - t_k| \, f \, \sigma_1

        with the standard deviations :math:`\sigma_1` (6 + D,) of a step within :math:`1 / f`
        (`pose_step_sigma`). Time may run backward.
        """
        model, pose = self.body.model, self.fit.pose
        elapsed = elapsed_steps(self.time_s, time_s)
        sigma = process_noise(model.tree, elapsed)
        if self.before is not None:
            before_s, before = self.before
            # The last step is repeated three times at most: nobody moves on straight for longer.
            ratio = min(elapsed / elapsed_steps(before_s, self.time_s), 3)
            pose = pose.moved(MOMENTUM * ratio * pose.minus(before)).clipped(
                model.tree.dof_limits_rad
            )
        return PosePrior(pose, sigma)

    def step(self, observation: Observation, time_s: float) -> "BodyTrack":
        """Track with the next frame."""
        prior = self.predict(time_s)
        # The longer since the last frame, the farther it may have moved.
        reach_m = REFINEMENT.searched_m
        if self.before is not None:
            steps = max(elapsed_steps(self.time_s, time_s), 1.0)
            reach_m = min(steps * REFINEMENT.predicted_m, reach_m)
        settings = RefineSettings(REFINEMENT.reaches_m(reach_m))
        fit = refine_fit(self.body, observation, prior.pose, prior, settings)
        if self.is_poor(fit.error):
            # It moved farther than expected, or otherwise: from the last pose, with longer reaches.
            prior = PosePrior(self.fit.pose, prior.sigma)
            second_try = refine_fit(self.body, observation, self.fit.pose, prior, SEARCHED)
            fit = min(fit, second_try, key=lambda one: one.error)
        errors = (*self.errors[1 - RECENT :], fit.error)
        return BodyTrack(self.body, time_s, fit, (self.time_s, self.fit.pose), errors)

    def with_limbs(self, observation: Observation) -> "BodyTrack":
        """Track with arms and legs searched again in its latest frame; itself where no better."""
        moved = move_limbs(self.body, observation, self.fit)
        if moved.error >= self.fit.error:
            return self
        return replace(self, fit=moved, errors=(*self.errors[:-1], moved.error))

    def follow(self, rig: Rig, moment: Moment) -> "BodyTrack":
        """Track with the next frame of pinhole cameras, of which only what is near to the predicted
        pose counts.
        """
        pose = self.predict(moment.time_s).pose
        return self.step(observed_near(self.body, rig, moment, pose), moment.time_s)


def process_noise(tree: KinematicTree, steps: float) -> FloatArray:
    """Standard deviations (6 + D,) of a pose's coordinates after a time in units of 1 / `FPS`."""
    return min(steps, TRACKING.longest_steps) * pose_step_sigma(tree)


def is_near(first_s: float, second_s: float) -> bool:
    """Whether a step from one time to another, s, reaches a pose: process noise still grows."""
    return elapsed_steps(first_s, second_s) <= TRACKING.longest_steps


@lru_cache(maxsize=64)
def views_of(rig: Rig, names: tuple[str, ...]) -> PinholeViews:
    """Some of a rig's cameras, packed."""
    return PinholeViews.from_rig(rig.select(list(names)))


def observed_near(body: BodyGeometry, rig: Rig, moment: Moment, pose: Pose) -> Observation:
    """Silhouettes of pinhole cameras without what is farther from a pose than a limb moves in a few
    frames.
    """
    views, points = moment.views(rig), body.surface.posed(pose).points[::4]
    near = []
    for c, mask in enumerate(moment.masks().values()):
        inside = points @ views.rotation[c].T + views.translation_m[c]
        depth = np.maximum(inside[:, 2], 0.1)
        focal, center = views.intrinsics[c, :2], views.intrinsics[c, 2:]
        height, width = mask.shape
        small = np.zeros((-(-height // _REDUCED), -(-width // _REDUCED)), np.uint8)
        pixels = (inside[:, :2] / depth[:, None] * focal + center) / _REDUCED
        x, y = np.clip(pixels, 0, np.array(small.shape[::-1]) - 1).astype(int).T
        small[y, x] = 1
        near_px = REFINEMENT.searched_m * focal[0] / float(np.median(depth))
        reach = max(round(near_px / _REDUCED), 1)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        size = small.shape[1] * _REDUCED, small.shape[0] * _REDUCED
        whole = cv2.resize(cv2.dilate(small, disc), size, interpolation=cv2.INTER_NEAREST)
        near.append(mask & whole[:height, :width].view(bool))
    return observation_at(views, near, pose.root_m)
