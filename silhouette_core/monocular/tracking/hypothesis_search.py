"""Search for the pose hypotheses of a frame.

The likeliest different samples of the posterior, the modes of a learned proposal and the
predictions from the hypotheses of the previous frame are refined on the silhouette. Beside a
proposal, limbs of the best ones are then put where they leave the silhouette uncovered; without
one, their mirror images in depth are added. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.tracking.beam import Beam, select_different
from silhouette_core.monocular.tracking.mirrored_limbs import mirrored_joints, mirrored_poses
from silhouette_core.monocular.tracking.observed_frame import ObservedFrame
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.monocular.tracking.tracker_settings import TrackerSettings
from silhouette_core.monocular.tracking.uncovered_limbs import reach_uncovered
from silhouette_core.monocular.tree.forward import FilterFrame, candidates_of
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.motion.dynamics import elapsed_steps, pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.joint_placement import place_bodies
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface

_FROM_LIBRARY = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_FROM_PREDICTION = RefineSettings(reaches_m=(0.12, 0.10, 0.08, 0.06))
_FROM_MODE = RefineSettings(reaches_m=(0.25, 0.18, 0.12, 0.09), contour_m=0.015, independence=0.3)
_ROWS = 150  # samples of the posterior that are considered
_LEAST_PROBABILITY = 0.02  # of a mode that becomes a hypothesis
_EXPLAINED = 0.04  # silhouette distance up to which no limb is looked for elsewhere

Hypotheses = tuple[list[Pose], list[LandmarkPrior | None]]
"""Poses, and the prior of the joints' positions that each was refined with."""


class HypothesisSearch:
    """Finds the hypotheses of one frame after the other.

    Args:
        tree: the tree filter.
        camera: pinhole camera without distortion.
        root: place of a root that stands still, with any joint angles; None: it moves.
    """

    def __init__(self, tree: TreeFilter, camera: Camera, root: Pose | None = None):
        """Prepares the deviations of the library's poses."""
        self.tree, self.camera, self.root = tree, camera, root
        model = tree.library.model
        self._library_sigma = np.concatenate(
            [[0.06] * 3, [0.15] * 3, np.full(model.dof_count, 0.20)]
        )
        if root is not None:
            self._library_sigma[:6] = pose_step_sigma(model.tree)[:6]

    def find(
        self,
        surface: Surface,
        filter_frame: FilterFrame,
        observed: ObservedFrame,
        past: tuple[Beam, list[Pose]] | None,
        modes: FrameModes | None,
        settings: TrackerSettings,
    ) -> Hypotheses:
        """Hypotheses of a frame.

        Args:
            surface: the body's.
            filter_frame: the frame and its posterior.
            observed: the frame's silhouette.
            past: hypotheses of the previous frame, and where each is expected in this one.
            modes: probable poses of the frame from the learned proposal, if there is one.
            settings: how many are wanted.
        """
        seeds = self._seeds(surface.model, filter_frame, settings)
        if not settings.refine:
            return seeds, [None] * len(seeds)
        found = self._refined(surface, observed, seeds, past, modes, settings)
        if modes is None:
            return self._mirroring(surface, observed, found, settings)
        return _reaching(surface, observed, found, modes, settings)

    def _seeds(
        self, model: BodyModel, filter_frame: FilterFrame, settings: TrackerSettings
    ) -> list[Pose]:
        """Samples of the posterior and of the best leaves that differ from each other."""
        posterior = filter_frame.posterior
        if settings.by_fit == 0 and settings.by_probability == 1:
            first = candidates_of(self.tree, filter_frame, [0])
            return [Pose(first.root_m[0], first.root_rotation[0], first.angles_rad[0])]
        by_fit = np.argsort(posterior.distance, kind="stable")[:_ROWS]
        rows = np.unique(np.concatenate([np.arange(min(len(posterior.samples), _ROWS)), by_fit]))
        samples = candidates_of(self.tree, filter_frame, rows)
        joints = landmarks(
            model,
            *place(model, samples.root_m, samples.root_rotation, samples.angles_rad),
        )
        by_probability, least = np.argsort(rows), settings.different_m
        by_fit = np.argsort(posterior.distance[rows], kind="stable")
        chosen = select_different(joints, by_probability, settings.by_probability, least)
        chosen += select_different(joints, by_fit, settings.by_fit, least, chosen)
        seeds = [
            Pose(samples.root_m[k], samples.root_rotation[k], samples.angles_rad[k]) for k in chosen
        ]
        root = self.root
        if root is None:
            return seeds
        return [Pose(root.root_m, root.root_rotation, seed.angles_rad) for seed in seeds]

    def _refined(
        self,
        surface: Surface,
        observed: ObservedFrame,
        seeds: list[Pose],
        past: tuple[Beam, list[Pose]] | None,
        modes: FrameModes | None,
        settings: TrackerSettings,
    ) -> Hypotheses:
        """Modes, seeds, then predictions of the best hypotheses, refined on the silhouette."""
        starts: list[RefineStart] = []
        if modes is not None:
            chosen = modes.probable(settings.by_mode, _LEAST_PROBABILITY)
            expected = [modes.priors[mode] for mode in chosen]
            placed = place_bodies(surface, observed.contour, expected)
            starts += [
                RefineStart(pose, _FROM_MODE, None, prior)
                for pose, prior in zip(placed, expected, strict=True)
            ]
        how = _FROM_LIBRARY if modes is None else _FROM_PREDICTION
        believed = [(pose, self._library_sigma, how) for pose in seeds]
        if past is not None:
            previous, predicted = past
            sigma = pose_step_sigma(surface.model.tree) * elapsed_steps(
                previous.time_s, observed.time_s
            )
            order = np.argsort(previous.cost, kind="stable")
            carried = select_different(
                previous.joints, order, settings.carried, settings.different_m
            )
            believed += [(predicted[k], sigma, _FROM_PREDICTION) for k in carried]
        starts += _starts(surface.model, believed, modes)
        refined = refine_many(surface, observed.contour, starts)
        return [one.pose for one in refined], [start.landmark_prior for start in starts]

    def _mirroring(
        self,
        surface: Surface,
        observed: ObservedFrame,
        found: Hypotheses,
        settings: TrackerSettings,
    ) -> Hypotheses:
        """Adds mirror images in depth of the best poses."""
        poses, priors = found
        best = np.argsort(observed.weights.distances(surface.model, poses), kind="stable")
        wanted = [
            image
            for joints in joints_of(surface.model, [poses[k] for k in best[: settings.mirrored]])
            for image in mirrored_joints(joints, self.camera.center_m)
        ]
        images = mirrored_poses(surface, observed, wanted)
        if not images:
            return found
        believed = [(pose, self._library_sigma, _FROM_PREDICTION) for pose in images]
        refined = refine_many(surface, observed.contour, _starts(surface.model, believed, None))
        return [*poses, *(one.pose for one in refined)], [*priors, *[None] * len(refined)]


def joints_of(model: BodyModel, poses: Sequence[Pose]) -> NDArray[np.float64]:
    """Joints (K, L, 3) of poses in the world."""
    if not poses:
        return np.empty((0, len(model.landmarks_m), 3))
    return landmarks(model, *place(model, *PoseArrays.from_poses(poses).arrays))


def _reaching(
    surface: Surface,
    observed: ObservedFrame,
    found: Hypotheses,
    modes: FrameModes,
    settings: TrackerSettings,
) -> Hypotheses:
    """Adds poses whose limbs reach where the best ones leave the silhouette uncovered."""
    poses, priors = found
    tried: list[int] = []
    for _ in range(settings.reaching):
        distance = observed.weights.distances(surface.model, poses)
        cost = settings.cost(distance) + modes.cost(joints_of(surface.model, poses))
        best = np.argsort(cost, kind="stable")[: settings.reaching]
        best = [int(k) for k in best if distance[k] > _EXPLAINED and k not in tried]
        known = [prior for prior in (priors[k] for k in best) if prior is not None]
        more, own = reach_uncovered(surface, observed, [poses[k] for k in best], known)
        if not more:
            break
        poses, priors, tried = [*poses, *more], [*priors, *own], [*tried, *best]
    return poses, priors


def _starts(
    model: BodyModel,
    believed: list[tuple[Pose, NDArray[np.float64], RefineSettings]],
    modes: FrameModes | None,
) -> list[RefineStart]:
    """Starts of the refinement from poses that are believed with deviations."""
    joints = joints_of(model, [pose for pose, _, _ in believed])
    return [
        RefineStart(
            pose, how, PosePrior(pose, sigma), None if modes is None else modes.nearest(own)
        )
        for (pose, sigma, how), own in zip(believed, joints, strict=True)
    ]
