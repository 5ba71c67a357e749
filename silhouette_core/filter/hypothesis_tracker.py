"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A library's poses are coarse, and a silhouette seen from one side allows many of them; only after
refinement can they be told apart. The likeliest different samples of the posterior are refined,
besides the predictions from the hypotheses of the previous frame, and Viterbi's recursion runs over
the refined poses. Predictions need no library: the body can be tracked into poses that were never
recorded. Beyond paper A.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.filter.beam import Beam, select_different
from silhouette_core.filter.forward import FilterFrame, candidates_of
from silhouette_core.filter.motion_cost import (
    PoseCandidates,
    ProcessNoise,
    transition_cost,
)
from silhouette_core.filter.observed_frame import FrameObserver, ObservedFrame
from silhouette_core.filter.pose_costs import PoseCosts
from silhouette_core.filter.pose_modes import FrameModes
from silhouette_core.filter.tracker_settings import TrackerSettings
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.filter.uncovered_limbs import reach_uncovered
from silhouette_core.library.occlusion import occluded_parts, usual_areas
from silhouette_core.motion.dynamics import (
    FPS,
    ROOT_STEP_M,
    ROOT_STEP_RAD,
    elapsed_steps,
    pose_step_sigma,
    predict,
)
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.joint_placement import place_bodies
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface

_FROM_LIBRARY = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_FROM_PREDICTION = RefineSettings(reaches_m=(0.12, 0.10, 0.08, 0.06))
_FROM_MODE = RefineSettings(reaches_m=(0.25, 0.18, 0.12, 0.09), contour_m=0.015, independence=0.3)
_ROWS = 150  # samples of the posterior that are considered
_STEADY = 0.4  # of the usual steps, of joints of bodies that are no person's
_LEAST_PROBABILITY = 0.02  # of a mode that becomes a hypothesis
_EXPLAINED = 0.04  # silhouette distance up to which no limb is looked for elsewhere
_LONGEST_FRAME = 3.0  # interval of frames up to which a frame counts more than one of 1 / FPS


class HypothesisTracker:
    """Tracks several pose hypotheses from frame to frame.

    Args:
        tree: the tree filter.
        camera: pinhole camera without distortion.
        settings: numbers and scores of hypotheses.
    """

    def __init__(self, tree: TreeFilter, camera: Camera, settings: TrackerSettings):
        """Prepares the body's surface and the costs of poses."""
        self.tree, self.camera, self.settings = tree, camera, settings
        self.views = PinholeViews.from_rig(Rig((camera,)))
        self.observer = FrameObserver(
            self.views, tree.library, settings.weighting, tree.backend, settings.spacing_m
        )
        self.costs = PoseCosts(tree.library)
        self.set_body(tree.library.model)
        self.noise = ProcessNoise(
            self._steadiness() * pose_step_sigma(self.model.tree)[6:],
            root_rad=ROOT_STEP_RAD,
            root_m=ROOT_STEP_M,
            spacing_rad=np.radians(3.0),
        )
        self._library_sigma = np.concatenate(
            [[0.06] * 3, [0.15] * 3, np.full(self.model.dof_count, 0.20)]
        )
        if settings.root is not None:
            self._library_sigma[:6] = pose_step_sigma(self.model.tree)[:6]
        self._usual_areas = usual_areas(tree.library.areas)

    def _steadiness(self) -> float:
        """Factor on the steps of joints: those of a body that is no person's are stated wide."""
        return 1.0 if self.model.person is not None else _STEADY

    def set_body(self, model: BodyModel) -> None:
        """Replaces the body, for example by one adapted to the person."""
        self.model = model
        self.surface = Surface(model, self.settings.surface_points)

    def step(
        self,
        filter_frame: FilterFrame,
        previous: Beam | None,
        before_previous: Beam | None,
        modes: FrameModes | None = None,
        observed: ObservedFrame | None = None,
        known: Beam | None = None,
        searched: bool = True,
    ) -> Beam:
        """Hypotheses of a frame.

        Args:
            filter_frame: the frame and its posterior.
            previous: hypotheses of the previous frame.
            before_previous: hypotheses of the frame before that.
            modes: probable poses of the frame from the learned proposal, if there is one.
            observed: the frame's silhouette, prepared by `observer`; None: it is prepared here.
            known: hypotheses of this frame that are added to those found.
            searched: whether any are looked for; else those known are all.
        """
        time_s, settings = filter_frame.time_s, self._settings(modes)
        if observed is None:
            distance_m = filter_frame.distance_m if modes is None else modes.distance_m
            observed = self.observer.observe(filter_frame.person.mask, distance_m, time_s)
        weights = observed.weights
        limits = self.model.dof_limits_rad
        predicted = [] if previous is None else _predicted(previous, before_previous, limits)
        poses: list[Pose] = self._seeds(filter_frame, settings) if searched else []
        priors: list[LandmarkPrior | None] = [None] * len(poses)
        if settings.refine and searched:
            poses, priors = self._refined(observed, poses, previous, predicted, modes, settings)
            if modes is not None:
                poses, priors = self._reaching(observed, poses, priors, modes, settings)
        if known is not None:
            poses, priors = [*poses, *known.poses], [*priors, *known.priors]
        distance = weights.distances(self.model, poses)
        joints = _joints(self.model, poses)
        own = 0.5 * (distance / settings.sigma) ** 2 + self.costs.off_floor(poses, self.surface)
        own += (
            self.costs.novelty(poses, joints) if modes is None else modes.cost(joints)
        ) + self.costs.walking_backward(poses, time_s)
        if previous is None:
            back, restarted = np.full(len(poses), -1), np.ones(len(poses), bool)
            if settings.facing and modes is None:
                toward = -filter_frame.windows[0].world_from_virtual[:, 2]
                own = own + self.costs.facing_away(poses, toward)
            cost = own
        else:
            # Costs of a frame are those of 1 / FPS; a longer one counts for as much more.
            own = own * float(np.clip((time_s - previous.time_s) * FPS, 0.0, _LONGEST_FRAME))
            expected = previous, predicted
            moving, restarted = self.moving(*expected, poses, joints, time_s, settings.restart)
            total = previous.cost[:, None] + moving
            back = total.argmin(0)
            restarted = restarted[back, np.arange(len(poses))]
            cost = own + total.min(0)
        beam = Beam(
            poses,
            joints,
            distance,
            cost - cost.min(),
            back,
            restarted,
            time_s,
            own,
            np.zeros((len(poses), len(self.model.names)), bool),
            priors,
            settings.temperature,
        )
        kept = self._pruned(beam, settings)
        for row, areas in enumerate(weights.part_areas_many(self.model, kept.poses)):
            kept.occluded[row] = occluded_parts(areas, self._usual_areas)
        self.costs.add_position(time_s, kept.poses[kept.best].root_m)
        return kept

    def moving(
        self,
        previous: Beam,
        predicted: list[Pose],
        poses: list[Pose],
        joints: NDArray[np.float64],
        time_s: float,
        restart: float,
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Costs of the steps from the hypotheses of the previous frame.

        Args:
            previous: K hypotheses of the previous frame.
            predicted: where each is expected in this frame.
            poses: K' poses of this frame.
            joints: (K', 15, 3), their joints.
            time_s: time of this frame.
            restart: see `TrackerSettings.restart`.

        Returns:
            Costs (K, K') float64, nats, and whether each is that of a restart (K, K') bool.
        """
        # At a lower frame rate every step is cheaper; a restart has to remain dearer.
        restart_cost = restart * max((time_s - previous.time_s) * FPS, 1.0)
        occluded = previous.occluded[:, self.model.dof_part]
        moving = transition_cost(
            _packed(predicted, previous.time_s, occluded & ~self.model.dof_fixed),
            _packed(poses, time_s),
            replace(self.noise, restart_cost=restart_cost),
        )
        steps = elapsed_steps(previous.time_s, time_s)
        slip = self.costs.slip(previous.joints, joints, steps)
        return moving + slip, moving >= restart_cost

    def _settings(self, modes: FrameModes | None) -> TrackerSettings:
        return self.settings if modes is None else self.settings.with_modes()

    def _seeds(self, filter_frame: FilterFrame, settings: TrackerSettings) -> list[Pose]:
        """Samples of the posterior and of the best leaves that differ from each other."""
        posterior = filter_frame.posterior
        if settings.by_fit == 0 and settings.by_probability == 1:
            first = candidates_of(self.tree, filter_frame, [0])
            return [Pose(first.root_m[0], first.root_rotation[0], first.angles_rad[0])]
        by_fit = np.argsort(posterior.distance, kind="stable")[:_ROWS]
        rows = np.unique(np.concatenate([np.arange(min(len(posterior.samples), _ROWS)), by_fit]))
        samples = candidates_of(self.tree, filter_frame, rows)
        joints = landmarks(
            self.model,
            *place(self.model, samples.root_m, samples.root_rotation, samples.angles_rad),
        )
        by_probability, least = np.argsort(rows), settings.different_m
        by_fit = np.argsort(posterior.distance[rows], kind="stable")
        chosen = select_different(joints, by_probability, settings.by_probability, least)
        chosen += select_different(joints, by_fit, settings.by_fit, least, chosen)
        seeds = [
            Pose(samples.root_m[k], samples.root_rotation[k], samples.angles_rad[k]) for k in chosen
        ]
        root = settings.root
        if root is None:
            return seeds
        return [Pose(root.root_m, root.root_rotation, seed.angles_rad) for seed in seeds]

    def _refined(
        self,
        observed: ObservedFrame,
        seeds: list[Pose],
        previous: Beam | None,
        predicted: list[Pose],
        modes: FrameModes | None,
        settings: TrackerSettings,
    ) -> tuple[list[Pose], list[LandmarkPrior | None]]:
        """Modes, seeds, then predictions of the best hypotheses, refined on the silhouette."""
        starts: list[RefineStart] = []
        if modes is not None:
            chosen = modes.probable(settings.by_mode, _LEAST_PROBABILITY)
            expected = [modes.priors[mode] for mode in chosen]
            placed = place_bodies(self.surface, observed.contour, expected)
            starts += [
                RefineStart(pose, _FROM_MODE, None, prior)
                for pose, prior in zip(placed, expected, strict=True)
            ]
        how = _FROM_LIBRARY if modes is None else _FROM_PREDICTION
        believed = [(pose, self._library_sigma, how) for pose in seeds]
        if previous is not None:
            sigma = pose_step_sigma(self.model.tree) * elapsed_steps(
                previous.time_s, observed.time_s
            )
            order = np.argsort(previous.cost, kind="stable")
            carried = select_different(
                previous.joints, order, settings.carried, settings.different_m
            )
            believed += [(predicted[k], sigma, _FROM_PREDICTION) for k in carried]
        joints = _joints(self.model, [pose for pose, _, _ in believed])
        for (pose, sigma, how), own in zip(believed, joints, strict=True):
            prior = None if modes is None else modes.nearest(own)
            starts.append(RefineStart(pose, how, PosePrior(pose, sigma), prior))
        refined = refine_many(self.surface, observed.contour, starts)
        return [one.pose for one in refined], [start.landmark_prior for start in starts]

    def _reaching(
        self,
        observed: ObservedFrame,
        poses: list[Pose],
        priors: list[LandmarkPrior | None],
        modes: FrameModes,
        settings: TrackerSettings,
    ) -> tuple[list[Pose], list[LandmarkPrior | None]]:
        """Adds poses whose limbs reach where the best ones leave the silhouette uncovered."""
        tried: list[int] = []
        for _ in range(settings.reaching):
            distance = observed.weights.distances(self.model, poses)
            cost = 0.5 * (distance / settings.sigma) ** 2 + modes.cost(_joints(self.model, poses))
            best = np.argsort(cost, kind="stable")[: settings.reaching]
            best = [int(k) for k in best if distance[k] > _EXPLAINED and k not in tried]
            known = [prior for prior in (priors[k] for k in best) if prior is not None]
            more, own = reach_uncovered(self.surface, observed, [poses[k] for k in best], known)
            if not more:
                break
            poses, priors, tried = [*poses, *more], [*priors, *own], [*tried, *best]
        return poses, priors

    def _pruned(self, beam: Beam, settings: TrackerSettings) -> Beam:
        """Cheapest hypotheses, only one of those that are the same pose."""
        order = np.argsort(beam.cost, kind="stable")
        return beam.chosen(select_different(beam.joints, order, settings.kept, settings.same_m))


def _predicted(
    previous: Beam, before_previous: Beam | None, limits_rad: NDArray[np.float64]
) -> list[Pose]:
    """Hypotheses of the previous frame moved on by one frame; restarted ones have no velocity."""
    if before_previous is None:
        return previous.poses
    return [
        predict(pose, None if restarted else before_previous.poses[back], limits_rad)
        for pose, back, restarted in zip(
            previous.poses, previous.back, previous.restarted, strict=True
        )
    ]


def _packed(
    poses: list[Pose], time_s: float, occluded: NDArray[np.bool_] | None = None
) -> PoseCandidates:
    return PoseCandidates(
        np.stack([pose.root_m for pose in poses]),
        np.stack([pose.root_rotation for pose in poses]),
        np.stack([pose.angles_rad for pose in poses]),
        (np.zeros((len(poses), len(poses[0].angles_rad)), bool) if occluded is None else occluded),
        np.zeros(len(poses)),
        time_s,
    )


def _joints(model: BodyModel, poses: list[Pose]) -> NDArray[np.float64]:
    """Joints (K, L, 3) of poses."""
    if not poses:
        return np.empty((0, len(model.landmarks_m), 3))
    return landmarks(model, *place(model, *PoseArrays.from_poses(poses).arrays))
