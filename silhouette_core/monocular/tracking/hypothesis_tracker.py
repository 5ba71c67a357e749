"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A silhouette seen from one side allows many poses, and only after refinement can they be told apart.
What the frame's proposal begins with, and the predictions from the hypotheses of the previous
frame, are refined on the silhouette. Viterbi's recursion runs over the refined poses. Beyond
paper A.
"""

from dataclasses import replace

import numpy as np

from calib.camera import Camera, Rig
from calib.checks import BoolArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.occlusion import occluded_parts
from silhouette_core.monocular.tracking.frame_costs import FrameCosts, Hypotheses, TrackerSettings
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, ObservedFrame
from silhouette_core.monocular.tracking.silhouette_weights import SignedWeights
from silhouette_core.monocular.tuning import MOTION_MODEL
from silhouette_core.monocular.window import STATURE_PX, Window, look_at
from silhouette_core.motion.dynamics import elapsed_steps, pose_step_sigma
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.tracking.beam import Beam, select_different
from silhouette_core.tracking.step_costs import StepCosts
from silhouette_core.tuning import REFINEMENT

FROM_PREDICTION = RefineSettings(REFINEMENT.near_reaches_m)  #: Of a pose that is nearly right.

FoundPoses = tuple[list[Pose], list[LandmarkPrior | None]]
"""Poses, and the prior of the joints' positions that each was refined with."""


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
        usual_areas: FloatArray,
        settings: TrackerSettings,
        backend: Backend,
    ):
        self.settings, self.backend = settings, backend
        self.views = PinholeViews.from_rig(Rig((camera,)))
        self._length_m = model.length_m
        self.costs = FrameCosts(settings.costs)
        self.set_body(model)
        self.step_costs = StepCosts(
            model.tree,
            settings.steadiness * pose_step_sigma(model.tree)[6:],
            MOTION_MODEL.magnification,
            settings.restart,
        )
        self._usual_areas = usual_areas

    def set_body(self, model: BodyModel) -> None:
        """Replaces the body, for example by one adapted to the person."""
        self.model = model
        self.surface = Surface(model, self.settings.surface_points)

    def observe(
        self, mask: BoolArray, distance_m: float, time_s: float, window: Window | None = None
    ) -> ObservedFrame:
        """Prepares a frame.

        Args:
            mask: (h, w) bool, the silhouette, not empty.
            window: of the silhouette at about that distance; None: it is made here.
        """
        settings, camera = self.settings, self.views.rig.cameras[0]
        if window is None:
            window = look_at(camera, mask, distance_m, STATURE_PX / self._length_m)
        weights = SignedWeights.from_window(window, self.backend, settings.reduction)
        contour = Observation.from_masks(self.views, [mask], distance_m)
        return ObservedFrame(mask, weights, contour, time_s)

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
            observed: the frame's silhouette, prepared by `observe`.
            past: hypotheses of the previous frame, and of the frame before that.
            known: hypotheses of this frame that are added to those found.
            searched: whether any are looked for; else those known are all.
        """
        previous, before_previous = past
        predicted = [] if previous is None else self.step_costs.expected(previous, before_previous)
        poses: list[Pose] = []
        priors: list[LandmarkPrior | None] = []
        if searched:
            poses, priors = self._refined(observed, proposal, previous, predicted)
        if known is not None:
            poses, priors = [*poses, *known.poses], [*priors, *known.priors]
        beam = self._beam(observed, proposal, poses, priors)
        if previous is not None:
            beam = self.step_costs.continued(beam, previous, predicted)
        return self._pruned(replace(beam, cost=beam.cost - beam.cost.min()))

    def _refined(
        self,
        observed: ObservedFrame,
        proposal: FrameProposal,
        previous: Beam | None,
        predicted: list[Pose],
    ) -> FoundPoses:
        """Hypotheses of a frame, from those of the previous one and where each is expected."""
        surface, settings = self.surface, self.settings
        starts = proposal.starts(surface, observed.contour)
        if previous is not None:
            steps = elapsed_steps(previous.time_s, observed.time_s)
            sigma = pose_step_sigma(self.model.tree) * steps
            order = np.argsort(previous.cost, kind="stable")
            carried = [
                predicted[k]
                for k in select_different(
                    previous.joints, order, settings.carried, settings.different_m
                )
            ]
            starts += [
                RefineStart(pose, FROM_PREDICTION, PosePrior(pose, sigma), proposal.nearest(joints))
                for pose, joints in zip(carried, joints_of(self.model, carried), strict=True)
            ]
        refined = refine_many(surface, observed.contour, starts)
        return [one.pose for one in refined], [start.landmark_prior for start in starts]

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
        seen = Hypotheses(poses, joints, distance, self.surface, proposal)
        areas = weights.part_areas(drawn, len(self.model.names))
        occluded = occluded_parts(areas, self._usual_areas)
        costs, time_s = self.costs(seen), observed.time_s
        return Beam.of_frame(poses, joints, distance, costs, time_s, occluded, priors)

    def _pruned(self, beam: Beam) -> Beam:
        """Cheapest hypotheses, only one of those that are the same pose."""
        order = np.argsort(beam.cost, kind="stable")
        settings = self.settings
        return beam.chosen(select_different(beam.joints, order, settings.most, settings.same_m))
