"""Tracking of several refined pose hypotheses per frame, each with the cheapest past before it.

A library's poses are coarse, and a silhouette seen from one side allows many of them; only after
refinement can they be told apart. The likeliest different samples of the posterior are refined,
besides the predictions from the hypotheses of the previous frame, and Viterbi's recursion runs over
the refined poses. Predictions need no library: the body can be tracked into poses that were never
recorded. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.filter.forward import FilterFrame, candidates_of
from silhouette_core.filter.limb_silhouette import SignedWeights
from silhouette_core.filter.motion_cost import (
    PoseCandidates,
    ProcessNoise,
    transition_cost,
)
from silhouette_core.filter.pose_costs import PoseCosts
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.filter.window import look_at
from silhouette_core.image.distance import Weighting
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.motion.dynamics import (
    FPS,
    POSE_STEP_SIGMA,
    ROOT_STEP_M,
    ROOT_STEP_RAD,
    STEP_SIGMA_RAD,
    elapsed_steps,
    predict,
)
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.surface import Surface

_FROM_LIBRARY = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_FROM_PREDICTION = RefineSettings(reaches_m=(0.12, 0.10, 0.08, 0.06))
_POINTS = 500
_ROWS = 150  # samples of the posterior that are considered
# Mean distance of the joints within which two seeds explain a silhouette alike, and within which
# two hypotheses are the same pose.
_DIFFERENT_M, _SAME_M = 0.07, 0.035


@dataclass(frozen=True)
class TrackerSettings:
    """How many hypotheses are tracked, and how they are scored.

    Attributes:
        refine: False leaves the library's poses as they are.
        weighting: pixel weights of the silhouette distance.
        facing: the person mostly faces the camera in the first frame.
        by_probability: number of seeds from the likeliest samples of the posterior.
        by_fit: number of seeds from the leaves that fit the silhouette best, whatever their prior.
        carried: number of hypotheses of the previous frame that are carried on; a worse one may
            turn out to be right.
        kept: number of hypotheses kept per frame.
        sigma: standard deviation of a refined pose's silhouette distance, relative to the
            silhouette's weight.
    """

    refine: bool = True
    weighting: Weighting = "balanced"
    facing: bool = True
    by_probability: int = 5
    by_fit: int = 3
    carried: int = 8
    kept: int = 16
    sigma: float = 0.06


@dataclass(frozen=True, eq=False)
class Beam:
    """Pose hypotheses of one frame, K of them.

    Attributes:
        poses: the K poses.
        joints: (K, 15, 3) float64, their joints in the world, m.
        distance: (K,) float64, silhouette distances.
        cost: (K,) float64, nats, of the cheapest past through each.
        back: (K,) int64, hypothesis of the previous frame in that past; -1 at a start.
        restarted: (K,) bool, whether the step from that hypothesis is a restart and no movement.
        time_s: time of the frame.
    """

    poses: list[Pose]
    joints: NDArray[np.float64]
    distance: NDArray[np.float64]
    cost: NDArray[np.float64]
    back: NDArray[np.int64]
    restarted: NDArray[np.bool_]
    time_s: float

    @property
    def best(self) -> int:
        """Index of the cheapest hypothesis."""
        return int(self.cost.argmin())


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
        self.model = tree.library.model
        self.views = PinholeViews.from_rig(Rig((camera,)))
        self.surface = Surface(self.model, _POINTS)
        self.costs = PoseCosts(tree.library, self.surface)
        self.noise = ProcessNoise(
            STEP_SIGMA_RAD,
            root_rad=ROOT_STEP_RAD,
            root_m=ROOT_STEP_M,
            spacing_rad=np.radians(3.0),
            restart_cost=15.0,
        )
        self._library_sigma = np.concatenate(
            [[0.06] * 3, [0.15] * 3, np.full(self.model.dof_count, 0.20)]
        )

    def step(
        self, filter_frame: FilterFrame, previous: Beam | None, before_previous: Beam | None
    ) -> Beam:
        """Hypotheses of a frame.

        Args:
            filter_frame: the frame and its posterior.
            previous: hypotheses of the previous frame.
            before_previous: hypotheses of the frame before that.
        """
        time_s = filter_frame.time_s
        window = look_at(
            self.camera,
            filter_frame.person.mask,
            filter_frame.distance_m,
            STATURE_PX / self.model.sizes.stature_m,
        )
        weights = SignedWeights.from_window(
            window,
            self.settings.weighting,
            backend=self.tree.backend,
            bounds_px=self.tree.library.bounds_px,
        )
        predicted = [] if previous is None else _predicted(previous, before_previous)
        poses = self._seeds(filter_frame)
        if self.settings.refine:
            poses = self._refined(filter_frame, poses, previous, predicted)
        distance = weights.distances(self.model, poses)
        joints = np.concatenate([_joints(self.model, pose) for pose in poses])
        cost = (
            0.5 * (distance / self.settings.sigma) ** 2
            + self.costs.novelty(poses, joints)
            + self.costs.off_floor(poses)
        )
        cost += self.costs.walking_backward(poses, time_s)
        if previous is None:
            back, restarted = np.full(len(poses), -1), np.ones(len(poses), bool)
            if self.settings.facing:
                toward = -filter_frame.windows[0].world_from_virtual[:, 2]
                cost = cost + self.costs.facing_away(poses, toward)
        else:
            # At a lower frame rate every step is cheaper; a restart has to remain dearer.
            restart_cost = self.noise.restart_cost * max((time_s - previous.time_s) * FPS, 1.0)
            moving = transition_cost(
                _packed(predicted, previous.time_s),
                _packed(poses, time_s),
                replace(self.noise, restart_cost=restart_cost),
            )
            total = (
                previous.cost[:, None]
                + moving
                + self.costs.slip(previous.joints, joints, elapsed_steps(previous.time_s, time_s))
            )
            back = total.argmin(0)
            restarted = moving[back, np.arange(len(poses))] >= restart_cost
            cost = cost + total.min(0)
        kept = self._pruned(
            Beam(poses, joints, distance, cost - cost.min(), back, restarted, time_s)
        )
        self.costs.add_position(time_s, kept.poses[kept.best].root_m)
        return kept

    def _seeds(self, filter_frame: FilterFrame) -> list[Pose]:
        """Samples of the posterior and of the best leaves that differ from each other."""
        posterior, settings = filter_frame.posterior, self.settings
        by_fit = np.argsort(posterior.distance, kind="stable")[:_ROWS]
        rows = np.unique(np.concatenate([np.arange(min(len(posterior.samples), _ROWS)), by_fit]))
        samples = candidates_of(self.tree, filter_frame, rows)
        joints = landmarks(
            self.model,
            *forward(
                self.model,
                samples.root_m,
                quaternions(samples.root_rotation),
                samples.angles_rad,
            ),
        )
        by_probability = np.argsort(rows)
        by_fit = np.argsort(posterior.distance[rows], kind="stable")
        chosen = select_different(joints, by_probability, settings.by_probability, _DIFFERENT_M)
        chosen += select_different(joints, by_fit, settings.by_fit, _DIFFERENT_M, chosen)
        return [
            Pose(samples.root_m[k], samples.root_rotation[k], samples.angles_rad[k]) for k in chosen
        ]

    def _refined(
        self,
        filter_frame: FilterFrame,
        seeds: list[Pose],
        previous: Beam | None,
        predicted: list[Pose],
    ) -> list[Pose]:
        """Seeds, then predictions of the best hypotheses, refined on the frame's silhouette."""
        observation = Observation.from_masks(
            self.views, [filter_frame.person.mask], filter_frame.distance_m
        )
        starts = [(pose, self._library_sigma, _FROM_LIBRARY) for pose in seeds]
        if previous is not None:
            sigma = POSE_STEP_SIGMA * elapsed_steps(previous.time_s, filter_frame.time_s)
            order = np.argsort(previous.cost, kind="stable")
            carried = select_different(previous.joints, order, self.settings.carried, _DIFFERENT_M)
            starts += [(predicted[k], sigma, _FROM_PREDICTION) for k in carried]
        return [
            refine(self.surface, observation, pose, PosePrior(pose, sigma), settings).pose
            for pose, sigma, settings in starts
        ]

    def _pruned(self, beam: Beam) -> Beam:
        """Cheapest hypotheses, only one of those that are the same pose."""
        order = np.argsort(beam.cost, kind="stable")
        chosen = select_different(beam.joints, order, self.settings.kept, _SAME_M)
        return Beam(
            [beam.poses[k] for k in chosen],
            beam.joints[chosen],
            beam.distance[chosen],
            beam.cost[chosen],
            beam.back[chosen],
            beam.restarted[chosen],
            beam.time_s,
        )


def backtrack(beams: list[Beam], last: int | None = None) -> list[int]:
    """Hypothesis of every frame along the cheapest past.

    Args:
        beams: hypotheses of consecutive frames.
        last: hypothesis of the last frame to start from; None: its cheapest.
    """
    chosen = [beams[-1].best if last is None else last]
    for beam in beams[:0:-1]:
        chosen.append(int(beam.back[chosen[-1]]))
    return chosen[::-1]


def select_different(
    joints: NDArray[np.float64],
    order: NDArray[np.int64],
    count: int,
    least_m: float,
    others: Sequence[int] = (),
) -> list[int]:
    """Indices of the first poses in an order that differ from each other.

    Args:
        joints: (K, 15, 3) float64, joints of the poses, m.
        order: indices of the poses, best first.
        count: largest number of poses.
        least_m: mean distance of the joints above which two poses differ.
        others: indices of poses from which the chosen ones must differ, too.
    """
    chosen: list[int] = []
    for k in order:
        if len(chosen) == count:
            break
        if all(
            np.linalg.norm(joints[k] - joints[other], axis=-1).mean() > least_m
            for other in (*others, *chosen)
        ):
            chosen.append(int(k))
    return chosen


def _predicted(previous: Beam, before_previous: Beam | None) -> list[Pose]:
    """Hypotheses of the previous frame moved on by one frame; restarted ones have no velocity."""
    if before_previous is None:
        return previous.poses
    return [
        predict(pose, None if restarted else before_previous.poses[back])
        for pose, back, restarted in zip(
            previous.poses, previous.back, previous.restarted, strict=True
        )
    ]


def _packed(poses: list[Pose], time_s: float) -> PoseCandidates:
    return PoseCandidates(
        np.stack([pose.root_m for pose in poses]),
        np.stack([pose.root_rotation for pose in poses]),
        np.stack([pose.angles_rad for pose in poses]),
        np.zeros((len(poses), len(poses[0].angles_rad)), bool),
        np.zeros(len(poses)),
        time_s,
    )


def _joints(model: BodyModel, pose: Pose) -> NDArray[np.float64]:
    return landmarks(
        model,
        *forward(
            model, pose.root_m[None], quaternions(pose.root_rotation[None]), pose.angles_rad[None]
        ),
    )
