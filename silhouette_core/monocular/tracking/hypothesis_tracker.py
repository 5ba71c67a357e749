"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A silhouette seen from one side allows many poses, and only after refinement can they be told apart.
What the frame's proposal begins with, and the predictions from the hypotheses of the previous
frame, are refined on the silhouette; limbs of the best ones are then put where they leave the
silhouette uncovered. Viterbi's recursion runs over the refined poses. Beyond paper A.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.occlusion import occluded_parts
from silhouette_core.monocular.silhouette_weights import SignedWeights
from silhouette_core.monocular.tracking.beam import Beam, select_different
from silhouette_core.monocular.tracking.frame_costs import FrameCosts, Hypotheses, TrackerSettings
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, ObservedFrame
from silhouette_core.monocular.tracking.uncovered_limbs import reach_uncovered
from silhouette_core.monocular.tuning import MODES, MOTION_MODEL
from silhouette_core.monocular.window import STATURE_PX, Window, look_at
from silhouette_core.motion.dynamics import (
    FPS,
    ROOT_STEP_M,
    ROOT_STEP_RAD,
    elapsed_steps,
    pose_step_sigma,
    predict,
)
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.ranking import rounded
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.tuning import REFINEMENT

FROM_PREDICTION = RefineSettings(reaches_m=REFINEMENT.near_reaches_m[1:-1])
"""Refinement of a pose that is nearly right."""

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
        usual_areas: NDArray[np.float64],
        settings: TrackerSettings,
        backend: Backend,
    ):
        self.settings, self.backend = settings, backend
        self.views = PinholeViews.from_rig(Rig((camera,)))
        self._length_m = model.length_m
        self.costs = FrameCosts(model.person is not None, settings.costs)
        self.set_body(model)
        self._sigma_rad = settings.steadiness * pose_step_sigma(model.tree)[6:]
        self._usual_areas = usual_areas

    def set_body(self, model: BodyModel) -> None:
        """Replaces the body, for example by one adapted to the person."""
        self.model = model
        self.surface = Surface(model, self.settings.surface_points)

    def observe(
        self,
        mask: NDArray[np.bool_],
        distance_m: float,
        time_s: float,
        window: Window | None = None,
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
        contour = Observation.from_masks(self.views, [mask], distance_m, settings.spacing_m)
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
        predicted = (
            []
            if previous is None
            else _predicted(previous, before_previous, self.model.tree.dof_limits_rad)
        )
        poses: list[Pose] = []
        priors: list[LandmarkPrior | None] = []
        if searched:
            poses, priors = self._found(observed, proposal, previous, predicted)
        if known is not None:
            poses, priors = [*poses, *known.poses], [*priors, *known.priors]
        beam = self._beam(observed, proposal, poses, priors)
        if previous is not None:
            beam = self._continued(beam, previous, predicted)
        return self._pruned(replace(beam, cost=beam.cost - beam.cost.min()))

    def _found(
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
                RefineStart(pose, FROM_PREDICTION, PosePrior(pose, sigma), proposal.nearest(own))
                for pose, own in zip(carried, joints_of(self.model, carried), strict=True)
            ]
        refined = refine_many(surface, observed.contour, starts)
        poses, priors = [one.pose for one in refined], [start.landmark_prior for start in starts]
        return self._reaching(observed, proposal, poses, priors)

    def _reaching(
        self,
        observed: ObservedFrame,
        proposal: FrameProposal,
        poses: list[Pose],
        priors: list[LandmarkPrior | None],
    ) -> FoundPoses:
        """Adds poses whose limbs reach where the best ones leave the silhouette uncovered."""
        settings = self.settings
        tried: list[int] = []
        for _ in range(settings.reaching):
            distance = observed.weights.distances(self.model, poses)
            cost = 0.5 * (distance / settings.costs.silhouette) ** 2
            cost += proposal.cost(joints_of(self.model, poses))
            best = np.argsort(rounded(cost), kind="stable")[: settings.reaching]
            # Within its sigma, nothing is missing.
            most = settings.costs.silhouette
            best = [int(k) for k in best if distance[k] > most and k not in tried]
            known = [prior for prior in (priors[k] for k in best) if prior is not None]
            more, own = reach_uncovered(self.surface, observed, [poses[k] for k in best], known)
            if not more:
                break
            poses, priors, tried = [*poses, *more], [*priors, *own], [*tried, *best]
        return poses, priors

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
        seen = Hypotheses(poses, joints, distance, drawn, self.surface, observed, proposal)
        own = rounded(self.costs(seen))
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
        )

    def _continued(self, beam: Beam, previous: Beam, predicted: list[Pose]) -> Beam:
        """Hypotheses with the cheapest past of each."""
        # Costs of a frame are those of 1 / FPS; a longer one counts for as much more.
        longer = float(np.clip((beam.time_s - previous.time_s) * FPS, 0.0, MODES.longest_frame))
        own = beam.own * longer
        moving, restarted = self.moving(previous, predicted, beam)
        total = rounded(previous.cost[:, None] + moving)
        back = total.argmin(0)
        return replace(
            beam,
            own=own,
            cost=rounded(own + total.min(0)),
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
        tree = self.model.tree
        moving = transition_cost(
            PoseArrays.from_poses(predicted),
            PoseArrays.from_poses(beam.poses),
            previous.occluded[:, tree.dof_part] & ~tree.dof_fixed,
            self._sigma_rad,
            elapsed_steps(previous.time_s, beam.time_s),
        )
        moving = np.minimum(moving, restart_cost)
        return moving, moving >= restart_cost

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


def transition_cost(
    before: PoseArrays,
    after: PoseArrays,
    occluded: NDArray[np.bool_],
    sigma_rad: NDArray[np.float64],
    steps: float,
) -> NDArray[np.float64]:
    """Negative logarithm of the transition probability between all poses of two frames.

    The random walk of :eq:`okada-4` and :eq:`okada-5` over joint angles, orientation and position;
    the source pose decides which parts are occluded. Beyond the paper, a spacing of 3 degrees and
    5 cm, of poses that refinement does not tell apart, is added to the variances.
    The normaliser of the Gaussian counts, since :eq:`okada-5` makes it differ between sources.

    Args:
        before: M poses of a frame.
        after: M' poses of the next frame.
        occluded: (M, D), whether the part that an angle turns is occluded, eq. (3).
        sigma_rad: (D,), deviations of the joint angles within 1 / `dynamics.FPS`.
        steps: time between the frames in units of 1 / `dynamics.FPS`.

    Returns:
        (M, M') float64, nats, up to a constant that is the same for all.

    Source: Okada and Stenger, eq. (4), (5); spacing is ours.
    """
    spacing_rad = np.radians(3.0)
    magnified = np.where(occluded, MOTION_MODEL.magnification, 1.0)  # eq. (5)
    sigma = np.sqrt((sigma_rad * steps * magnified) ** 2 + spacing_rad**2)
    scaled = before.angles_rad / sigma
    # Eq. (4): |a - b|^2 with a's own scale, expanded so that no (M, M', D) array is made.
    precision = 1.0 / sigma**2
    cost = (
        (scaled**2).sum(1)[:, None]
        - 2 * (scaled / sigma) @ after.angles_rad.T
        + precision @ (after.angles_rad**2).T
    )
    # The angle between rotations from the trace of their quotient.
    trace = np.einsum("aij,bij->ab", before.root_rotation, after.root_rotation)
    turn = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
    cost += turn**2 / ((ROOT_STEP_RAD * steps) ** 2 + spacing_rad**2)
    gap = before.root_m[:, None] - after.root_m[None]
    cost += (gap**2).sum(-1) / ((ROOT_STEP_M * steps) ** 2 + 0.05**2)
    # A wider Gaussian is lower: without its normaliser every occluded part would be a bonus.
    usual = np.sqrt((sigma_rad * steps) ** 2 + spacing_rad**2)
    widened = np.log(sigma / usual).sum(1)[:, None]
    return 0.5 * np.maximum(cost, 0.0) + widened
