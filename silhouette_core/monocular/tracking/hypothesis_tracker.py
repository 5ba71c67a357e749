"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A silhouette seen from one side allows many poses, and only after refinement can they be told apart.
Those that `hypothesis_search` finds are refined, and Viterbi's recursion runs over the refined
poses. Beyond paper A.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.occlusion import occluded_parts
from silhouette_core.monocular.tracking.beam import Beam, select_different
from silhouette_core.monocular.tracking.frame_costs import FrameCosts, Hypotheses, TrackerSettings
from silhouette_core.monocular.tracking.hypothesis_search import find_hypotheses, joints_of
from silhouette_core.monocular.tracking.motion_cost import (
    PoseCandidates,
    ProcessNoise,
    transition_cost,
)
from silhouette_core.monocular.tracking.observed_frame import (
    FrameObserver,
    FrameProposal,
    ObservedFrame,
)
from silhouette_core.monocular.tuning import MODES
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
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU


class HypothesisTracker:
    """Tracks several pose hypotheses from frame to frame.

    Args:
        camera: pinhole camera without distortion.
        usual_areas: (parts,) largest area that each part usually shows, see `occlusion`.
    """

    def __init__(
        self,
        model: BodyModel,
        camera: Camera,
        usual_areas: NDArray[np.float64],
        settings: TrackerSettings,
        backend: Backend = CPU,
    ):
        self.settings, self.backend = settings, backend
        self.views = PinholeViews.from_rig(Rig((camera,)))
        self.observer = FrameObserver(
            self.views, model.length_m, settings.reduction, settings.spacing_m, backend
        )
        self.costs = FrameCosts(model.person is not None, settings.costs)
        self.set_body(model)
        self.noise = ProcessNoise(
            settings.steadiness * pose_step_sigma(model.tree)[6:],
            root_rad=ROOT_STEP_RAD,
            root_m=ROOT_STEP_M,
            spacing_rad=np.radians(3.0),
        )
        self._usual_areas = usual_areas

    def set_body(self, model: BodyModel) -> None:
        """Replaces the body, for example by one adapted to the person."""
        self.model = model
        self.surface = Surface(model, self.settings.surface_points)

    def step(
        self,
        observed: ObservedFrame,
        proposal: FrameProposal,
        past: tuple[Beam | None, Beam | None],
        known: Beam | None = None,
        searched: bool = True,
    ) -> Beam:
        """Hypotheses of a frame.

        Args:
            observed: the frame's silhouette, prepared by `observer`.
            past: hypotheses of the previous frame, and of the frame before that.
            known: hypotheses of this frame that are added to those found.
            searched: whether any are looked for; else those known are all.
        """
        previous, before_previous = past
        predicted = (
            []
            if previous is None
            else _predicted(previous, before_previous, self.model.tree.dof_limits_rad)
        )
        poses: list[Pose] = []
        priors: list[LandmarkPrior | None] = []
        if searched:
            expected = None if previous is None else (previous, predicted)
            poses, priors = find_hypotheses(
                self.surface, observed, proposal, expected, self.settings
            )
        if known is not None:
            poses, priors = [*poses, *known.poses], [*priors, *known.priors]
        beam = self._beam(observed, proposal, poses, priors)
        if previous is not None:
            beam = self._continued(beam, previous, predicted)
        kept = self._pruned(replace(beam, cost=beam.cost - beam.cost.min()))
        self.costs.add_best(observed.time_s, kept.poses[kept.best])
        return kept

    def _beam(
        self,
        observed: ObservedFrame,
        proposal: FrameProposal,
        poses: list[Pose],
        priors: list[LandmarkPrior | None],
    ) -> Beam:
        """Hypotheses with the costs of their frame alone."""
        weights = observed.weights
        distance, joints = weights.distances(self.model, poses), joints_of(self.model, poses)
        drawn = weights.part_images(self.model, poses)
        own = self.costs(
            Hypotheses(poses, joints, distance, drawn, self.surface, observed, proposal)
        )
        areas = weights.part_areas(drawn, len(self.model.names))
        return Beam(
            poses,
            joints,
            distance,
            own,
            np.full(len(poses), -1),
            np.ones(len(poses), bool),
            observed.time_s,
            own,
            occluded_parts(areas, self._usual_areas),
            priors,
            self.settings.temperature,
        )

    def _continued(self, beam: Beam, previous: Beam, predicted: list[Pose]) -> Beam:
        """Hypotheses with the cheapest past of each."""
        # Costs of a frame are those of 1 / FPS; a longer one counts for as much more.
        longer = float(np.clip((beam.time_s - previous.time_s) * FPS, 0.0, MODES.longest_frame))
        own = beam.own * longer
        moving, restarted = self.moving(previous, predicted, beam)
        total = previous.cost[:, None] + moving
        back = total.argmin(0)
        return replace(
            beam,
            own=own,
            cost=own + total.min(0),
            back=back,
            restarted=restarted[back, np.arange(len(back))],
        )

    def moving(
        self, previous: Beam, predicted: list[Pose], beam: Beam
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Costs of the steps from the hypotheses of the previous frame.

        Returns:
            Costs (K, K') float64, nats, and whether each is that of a restart (K, K') bool.
        """
        # At a lower frame rate every step is cheaper; a restart has to remain dearer.
        restart_cost = self.settings.restart * max((beam.time_s - previous.time_s) * FPS, 1.0)
        occluded = previous.occluded[:, self.model.tree.dof_part]
        moving = transition_cost(
            _packed(predicted, previous.time_s, occluded & ~self.model.tree.dof_fixed),
            _packed(beam.poses, beam.time_s),
            replace(self.noise, restart_cost=restart_cost),
        )
        steps = elapsed_steps(previous.time_s, beam.time_s)
        return moving + self.costs.slip(previous.joints, beam.joints, steps), moving >= restart_cost

    def _pruned(self, beam: Beam) -> Beam:
        """Cheapest hypotheses, only one of those that are the same pose."""
        order = np.argsort(beam.cost, kind="stable")
        settings = self.settings
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
        time_s,
    )
