"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A library's poses are coarse, and a silhouette seen from one side allows many of them; only after
refinement can they be told apart. Those that `hypothesis_search` finds are refined, and Viterbi's
recursion runs over the refined poses. Predictions need no library: the body can be tracked into
poses that were never recorded. Beyond paper A.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.occlusion import occluded_parts, usual_areas
from silhouette_core.monocular.tracking.beam import Beam, select_different
from silhouette_core.monocular.tracking.hypothesis_search import HypothesisSearch, joints_of
from silhouette_core.monocular.tracking.motion_cost import (
    PoseCandidates,
    ProcessNoise,
    transition_cost,
)
from silhouette_core.monocular.tracking.observed_frame import FrameObserver, ObservedFrame
from silhouette_core.monocular.tracking.pose_costs import PoseCosts
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.monocular.tracking.tracker_settings import TrackerSettings
from silhouette_core.monocular.tree.forward import FilterFrame
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.motion.dynamics import (
    FPS,
    ROOT_STEP_M,
    ROOT_STEP_RAD,
    elapsed_steps,
    pose_step_sigma,
    predict,
)
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.surface import Surface

_STEADY = 0.4  # of the usual steps, of joints of bodies that are no person's
# What stands out of the body by less is cloth or hair; deviation, and the distance above which more
# costs no more.
_COVERED_M, _UNCOVERED_SIGMA_M, _MOST_UNCOVERED_M = 0.05, 0.03, 0.20
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
        self.search = HypothesisSearch(tree, camera, settings.root)
        self.set_body(tree.library.model)
        self.noise = ProcessNoise(
            self._steadiness() * pose_step_sigma(self.model.tree)[6:],
            root_rad=ROOT_STEP_RAD,
            root_m=ROOT_STEP_M,
            spacing_rad=np.radians(3.0),
        )
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
        poses: list[Pose] = []
        priors: list[LandmarkPrior | None] = []
        if searched:
            past = None if previous is None else (previous, predicted)
            poses, priors = self.search.find(
                self.surface, filter_frame, observed, past, modes, settings
            )
        if known is not None:
            poses, priors = [*poses, *known.poses], [*priors, *known.priors]
        distance = weights.distances(self.model, poses)
        joints = joints_of(self.model, poses)
        own = settings.cost(distance) + self.costs.off_floor(poses, self.surface)
        drawn = weights.part_images(self.model, poses)
        areas = weights.part_areas(drawn, len(self.model.names))
        if self.model.person is not None:
            own += _uncovered_cost(weights.uncovered(poses, drawn, _MOST_UNCOVERED_M))
            if observed.skin is not None:
                own += observed.skin.cost(drawn, weights.mask)
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
            np.stack([occluded_parts(one, self._usual_areas) for one in areas]),
            priors,
            settings.temperature,
        )
        kept = self._pruned(beam, settings)
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

    def _pruned(self, beam: Beam, settings: TrackerSettings) -> Beam:
        """Cheapest hypotheses, only one of those that are the same pose."""
        order = np.argsort(beam.cost, kind="stable")
        return beam.chosen(select_different(beam.joints, order, settings.kept, settings.same_m))


def _uncovered_cost(uncovered_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cost (K,), nats, of what stands out of the bodies by distances (K,): a hand is so small that
    the silhouette distance hardly tells where it is.
    """
    return 0.5 * (np.maximum(uncovered_m - _COVERED_M, 0.0) / _UNCOVERED_SIGMA_M) ** 2


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
