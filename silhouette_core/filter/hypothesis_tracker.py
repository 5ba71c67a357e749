"""Several refined poses per frame, each with the likeliest past that leads to it.

A library's poses are coarse, and a silhouette seen from one side allows many of them: only after
the refinement can it be told which fits. So the likeliest different samples of the posterior are
refined, beside what the poses of the frame before go on to, and Viterbi's
recursion runs over the refined poses. What goes on from frame to frame needs no library: the body
can be followed into poses that were never recorded. Beyond paper A.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.filter.forward import FilterFrame, candidates_of
from silhouette_core.filter.limb_silhouette import SignedWeights
from silhouette_core.filter.motion_cost import PoseCandidates, ProcessNoise, transition_cost, turned
from silhouette_core.filter.tree_filter import TreeFilter
from silhouette_core.filter.window import look_at
from silhouette_core.image.distance import Weighting
from silhouette_core.library.rendering import STATURE_PX
from silhouette_core.motion.heading import split_heading
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.pose import STEP_SIGMA_RAD, Pose
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.surface import Surface

_FROM_LIBRARY = RefineSettings(reaches_m=(0.15, 0.12, 0.10, 0.08, 0.06, 0.06))
_GOING_ON = RefineSettings(reaches_m=(0.12, 0.10, 0.08, 0.06))
_POINTS = 500
_MOMENTUM = 0.8
_DIFFERENT_M, _ALIKE_M = (
    0.07,
    0.035,
)  # mean distance of the joints: other explanations of a silhouette; the same pose twice
_FACING = 10.0  # nats against standing in profile in the first frame
_NEAR_FLOOR_M, _SUNK_M, _HOVERING_M = 0.20, 0.03, 0.06
_FAR = 4.0
_PACE_S, _WALKING_M_S, _BACKWARD = (
    0.7,
    0.4,
    1.0,
)  # nats a frame against walking sideways, twice that against backward
_ANKLES = [LANDMARK_NAMES.index(name) for name in ("left_ankle", "right_ankle")]


@dataclass(frozen=True)
class TrackerSettings:
    """How many poses are followed, and how they are judged.

    Attributes: refine: False leaves the library's poses as they are. weighting: of the silhouette
        distance. facing: in the first frame the person mostly faces the camera. likely: samples of
        the posterior that are tried, likeliest first, each unlike the others. fitting: likewise of
        the leaves whose silhouettes fit best, whatever was expected. going_on: poses of the frame
        before that are carried on, each unlike the others: a worse explanation may turn out the
        right one. kept: poses kept per frame. sigma: standard deviation of a refined pose's
        silhouette distance, relative to the silhouette's weight. unlike_m: mean distance of the
        joints to the nearest recorded pose at which a pose costs half a nat; a depth that no
        recording
            shows is unlikely, though the silhouette allows it.
        slip_m: how far the steadier foot moves within 1/30 s, at half a nat; whoever walks stands
            on one of the feet.
    """

    refine: bool = True
    weighting: Weighting = "balanced"
    facing: bool = True
    likely: int = 5
    fitting: int = 3
    going_on: int = 8
    kept: int = 16
    sigma: float = 0.06
    unlike_m: float = 0.06
    slip_m: float = 0.02


@dataclass(frozen=True, eq=False)
class Beam:
    """One frame's poses, K of them.

    Attributes: poses: the poses. joints: (K, 15, 3) float64, their joints, world, m. distance: (K,)
        silhouette distances. cost: (K,) float64, of the best past through each, in nats. back: (K,)
        int64, the pose of the frame before in that past; -1 at a start. restarted: (K,) bool,
        whether the pose is no movement on from that one: the past then tells nothing of its speed.
        time_s: of the frame.
    """

    poses: list[Pose]
    joints: NDArray[np.float64]
    distance: NDArray[np.float64]
    cost: NDArray[np.float64]
    back: NDArray[np.int64]
    restarted: NDArray[np.bool_]
    time_s: float


class HypothesisTracker:
    """Follows several poses at once.

    Args:
        tree: the filter.
        camera: without distortion.
        settings: see TrackerSettings.
    """

    def __init__(self, tree: TreeFilter, camera: Camera, settings: TrackerSettings):
        """Prepares the body's surface."""
        self.tree, self.camera, self.settings = tree, camera, settings
        self.model = tree.library.model
        self.views = PinholeViews.of(Rig((camera,)))
        self.surface = Surface(self.model, _POINTS)
        library = tree.library
        count = len(library.base_angles)
        recorded = forward(
            self.model,
            np.zeros((count, 3)),
            library.base_quaternion.astype(float),
            library.base_angles.astype(float),
        )
        joints = landmarks(self.model, *recorded)
        self._recorded = joints - joints[:, :1]
        self.rest = ProcessNoise(
            STEP_SIGMA_RAD, turn_rad=0.12, place_m=0.05, grain_rad=np.radians(3.0), jump=15.0
        )
        dofs = self.model.dof_count
        self._floor: bool | None = None
        self._recent: list[tuple[float, NDArray[np.float64]]] = []
        self._library_sigma = np.concatenate([[0.06] * 3, [0.15] * 3, np.full(dofs, 0.20)])
        self._onward_sigma = np.concatenate([[0.05] * 3, [0.12] * 3, STEP_SIGMA_RAD])

    def step(self, filter_frame: FilterFrame, last: Beam | None, before_last: Beam | None) -> Beam:
        """Finds a frame's poses.

        Args:
            filter_frame: the frame's posterior.
            last: the poses of the frame before, before_last: of the one before that.
        """
        distance_m = filter_frame.distance_m
        window = look_at(
            self.camera,
            filter_frame.person.mask,
            distance_m,
            STATURE_PX / self.model.sizes.stature_m,
        )
        picture = SignedWeights.of(window, self.settings.weighting)
        seeds = self._seeds(filter_frame)
        if self.settings.refine:
            seen = Observation.of(self.views, [filter_frame.person.mask], distance_m)
            poses = [
                self._refined(seen, pose, self._library_sigma, _FROM_LIBRARY) for pose in seeds
            ]
            if last is not None:
                sigma = self._onward_sigma * max((filter_frame.time_s - last.time_s) * 30.0, 0.5)
                expected = self._expected(last, before_last)
                carried = _unlike_each_other(
                    last.joints,
                    np.argsort(last.cost, kind="stable"),
                    self.settings.going_on,
                    _DIFFERENT_M,
                )
                poses += [self._refined(seen, expected[k], sigma, _GOING_ON) for k in carried]
        else:
            poses = seeds
        distance = np.array([picture.distance(self.model, pose) for pose in poses])
        joints = np.concatenate([_joints(self.model, pose) for pose in poses])
        cost = (
            0.5 * (distance / self.settings.sigma) ** 2
            + self._unlike(poses, joints)
            + self._off_floor(poses)
        )
        cost += self._walking_backward(poses, filter_frame.time_s)
        if last is None:
            back, restarted = np.full(len(poses), -1), np.ones(len(poses), bool)
            cost = cost + self._start_cost(filter_frame, poses)
        else:
            expected = _packed(self._expected(last, before_last), last.time_s)
            # At a slower rate every link is looser; beginning anew has to stay the dearer.
            rest = replace(
                self.rest,
                jump=self.rest.jump * max((filter_frame.time_s - last.time_s) * 30.0, 1.0),
            )
            moving = transition_cost(expected, _packed(poses, filter_frame.time_s), rest)
            total = last.cost[:, None] + moving + self._slip(last, joints, filter_frame.time_s)
            back = total.argmin(0)
            restarted = moving[back, np.arange(len(poses))] >= rest.jump
            cost = cost + total.min(0)
        kept = self._best(
            Beam(poses, joints, distance, cost - cost.min(), back, restarted, filter_frame.time_s)
        )
        self._recent.append((filter_frame.time_s, kept.poses[int(kept.cost.argmin())].root_m[:2]))
        return kept

    def _seeds(self, filter_frame: FilterFrame) -> list[Pose]:
        """Takes samples unlike each other, of the posterior and of the best leaves."""
        posterior, settings = filter_frame.posterior, self.settings
        by_fit = np.argsort(posterior.distance, kind="stable")[:150]
        rows = np.unique(np.concatenate([np.arange(min(len(posterior.samples), 150)), by_fit]))
        found = candidates_of(self.tree, filter_frame, rows)
        joints = landmarks(
            self.model,
            *forward(self.model, found.root_m, quaternions(found.root_rotation), found.angles_rad),
        )
        by_probability, by_fit = (
            np.argsort(rows),
            np.argsort(posterior.distance[rows], kind="stable"),
        )
        chosen = _unlike_each_other(joints, by_probability, settings.likely, _DIFFERENT_M)
        chosen += _unlike_each_other(joints, by_fit, settings.fitting, _DIFFERENT_M, chosen)
        return [Pose(found.root_m[k], found.root_rotation[k], found.angles_rad[k]) for k in chosen]

    def _expected(self, last: Beam, before_last: Beam | None) -> list[Pose]:
        """Where the last poses would be now if they went on as they came."""
        if before_last is None:
            return last.poses
        return [
            (
                pose
                if restarted
                else pose.moved(_MOMENTUM * pose.minus(before_last.poses[back])).clipped()
            )
            for pose, back, restarted in zip(last.poses, last.back, last.restarted, strict=True)
        ]

    def _refined(
        self, seen: Observation, pose: Pose, sigma: NDArray[np.float64], settings: RefineSettings
    ) -> Pose:
        return refine(self.surface, seen, pose, PosePrior(pose, sigma), settings).pose

    def _unlike(self, poses: list[Pose], joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """What it costs poses (K,) to be unlike all that was recorded, headings aside."""
        headless = [_without_heading(pose.root_rotation) for pose in poses]
        seen = np.stack([(own - own[0]) @ turn for own, turn in zip(joints, headless, strict=True)])
        nearest = np.array(
            [np.linalg.norm(self._recorded - own, axis=-1).mean(1).min() for own in seen]
        )
        off = nearest / self.settings.unlike_m
        return np.where(
            off < _FAR, 0.5 * off**2, _FAR * (off - 0.5 * _FAR)
        )  # far away, farther still matters less

    def _off_floor(self, poses: list[Pose]) -> NDArray[np.float64]:
        """What it costs poses (K,) to hover over the floor or to sink into it: a leg at the wrong
        depth does one or the other.

        The world's z = 0 is the floor if the calibration says so, which is believed once somebody
        is found to stand near it.
        """
        lowest = np.array([self.surface.posed(pose).points[:, 2].min() for pose in poses])
        if self._floor is None:
            self._floor = bool(np.median(np.abs(lowest)) < _NEAR_FLOOR_M)
        if not self._floor:
            return np.zeros(len(poses))
        off = np.where(lowest < 0, -lowest / _SUNK_M, lowest / _HOVERING_M)
        return 0.5 * np.minimum(off, 3.0) ** 2

    def _walking_backward(self, poses: list[Pose], time_s: float) -> NDArray[np.float64]:
        """What it costs poses (K,) to face away from where the person has been going: hardly
        anybody walks backward.

        A silhouette seen from the front is nearly that seen from behind; the way across the floor
        tells which it is.
        """
        self._recent = [(t, place) for t, place in self._recent if time_s - t <= _PACE_S]
        if len(self._recent) < 3 or self._recent[-1][0] - self._recent[0][0] < 0.5 * _PACE_S:
            return np.zeros(len(poses))
        times, places = (np.array(column) for column in zip(*self._recent, strict=True))
        pace = np.polyfit(times - times.mean(), places, 1)[0]
        speed = float(np.linalg.norm(pace))
        if speed < _WALKING_M_S:
            return np.zeros(len(poses))
        forward_of = np.array([-pose.root_rotation[:2, 1] for pose in poses])
        return _BACKWARD * (1 - forward_of @ (pace / speed))

    def _slip(self, last: Beam, joints: NDArray[np.float64], time_s: float) -> NDArray[np.float64]:
        """What it costs (K, K') that both feet move at once."""
        pace = max((time_s - last.time_s) * 30.0, 0.5)
        moved = np.linalg.norm(
            last.joints[:, None, _ANKLES] - joints[None, :, _ANKLES], axis=-1
        ).min(-1)
        return 0.5 * np.minimum(moved / (self.settings.slip_m * pace), 2.0) ** 2

    def _start_cost(self, filter_frame: FilterFrame, poses: list[Pose]) -> NDArray[np.float64]:
        """The initial prior of the refined poses: that of the filter, by the heading."""
        toward = -filter_frame.windows[0].world_from_virtual[:, 2]
        facing = np.array([-pose.root_rotation[:, 1] @ toward for pose in poses])
        return _FACING * (1 - facing) if self.settings.facing else np.zeros(len(poses))

    def _best(self, states: Beam) -> Beam:
        """Keeps the best poses, of those alike only one."""
        order = np.argsort(states.cost, kind="stable")
        chosen = _unlike_each_other(states.joints, order, self.settings.kept, _ALIKE_M)
        return Beam(
            [states.poses[k] for k in chosen],
            states.joints[chosen],
            states.distance[chosen],
            states.cost[chosen],
            states.back[chosen],
            states.restarted[chosen],
            states.time_s,
        )


def backtrack(states: list[Beam], last: int | None = None) -> list[int]:
    """Follows the best past back from the last frame's best pose (or from pose `last`); returns the
    pose taken in every frame.
    """
    taken = [int(states[-1].cost.argmin()) if last is None else last]
    for frame in states[:0:-1]:
        taken.append(int(frame.back[taken[-1]]))
    return taken[::-1]


def _unlike_each_other(
    joints: NDArray[np.float64],
    order: NDArray[np.int64],
    count: int,
    least_m: float,
    beside: Sequence[int] = (),
) -> list[int]:
    """Takes poses in an order, leaving out those whose joints (K, 15, 3) are within `least_m`
    (mean) of one taken before.
    """
    taken: list[int] = []
    for k in order:
        if len(taken) == count:
            break
        if all(
            np.linalg.norm(joints[k] - joints[other], axis=-1).mean() > least_m
            for other in (*beside, *taken)
        ):
            taken.append(int(k))
    return taken


def _without_heading(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the turn (3, 3) about the vertical that an orientation holds, as `split_heading`
    finds it.
    """
    heading, _ = split_heading(quaternions(rotation[None]))
    return turned(heading)[0]


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
