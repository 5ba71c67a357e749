"""The two estimators in live use: silhouettes of a moment in, posed bodies out."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.points import nearest_point
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.monocular.monocular_stages import MonocularOptions, PoseStages, person_for
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.person_finder import LONG_SIDE_PX, PersonFinder
from silhouette_core.monocular.tree_estimator import TreeFollower, TreeOptions, library_of
from silhouette_core.motion.dynamics import FPS
from silhouette_core.motion.kinematics import centres_of, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.progress import Reporter, SilentReporter, StageClock
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import Backend, load_backend
from silhouette_core.scoring.silhouette_error import body_masks
from silhouette_core.tuning import MEASURING
from silhouette_core.workers import SPAWN, leave_interrupts
from voxelpose.live.live_frame import Hypotheses, People, PosedBody
from voxelpose.live.live_silhouettes import long_side_px
from voxelpose.live.remote_object import RemoteObject
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import body_rule
from voxelpose.multiview.people.pose_followers import FoundPerson, PoseFollowers
from voxelpose.multiview.tracking.body_track import Moment
from voxelpose.multiview.tracking.follower import adapt_body, search, search_limbs
from voxelpose.multiview.tuning import CARVING
from voxelpose.tuning import LIVE

Pictures = Mapping[str, NDArray[np.uint8]]
SeenPerson = tuple[int, float, Person]
"""Number and time of a frame, and the person in it."""

_HYPOTHESES = 5


@dataclass(frozen=True, eq=False)
class LiveMoment:
    """What is estimated from: silhouettes packed, pictures (H, W, 3) BGR by camera, if needed."""

    number: int
    time_s: float
    silhouettes: Moment
    pictures: Pictures


class _ChangedModels:
    """What finds poses, whose large body models are sent only when they have changed."""

    def __init__(self, make: Callable[..., Any], arguments: tuple[object, ...]):
        self._finder = make(*arguments)
        self._sent: dict[int, BodyModel] = {}  # by person

    def step(self, given: object) -> People:
        people = list(self._finder.step(given))
        for k, body in enumerate(people):
            if body is not None:
                known, self._sent[k] = body.model is self._sent.get(k), body.model
                people[k] = replace(body, model=None) if known else body  # type: ignore[arg-type]
        return tuple(people)

    def close(self) -> None:
        self._finder.close()


class LiveEstimator(RemoteObject, ABC):
    """Finds people in one moment after the other, in two stages that run in a thread each: the
    second in a process of its own.

    Args:
        make: makes what does it there, with the methods `step` and `close`; a function or class of
            a module, whose InputError is raised here.
    """

    def __init__(self, make: Callable[..., Any], *arguments: object):
        super().__init__(_ChangedModels, make, arguments)
        self._models: dict[int, BodyModel] = {}  # by person
        self.wait()

    @abstractmethod
    def prepare(self, moment: LiveMoment, /) -> Any:
        """What the second stage needs of a moment."""

    def step(self, given: Any) -> People:
        """Everybody by number, None where there is none, from what `prepare` made."""
        people: list[PosedBody | None] = []
        for k, body in enumerate(self.call("step", given)):
            if body is not None:
                self._models[k] = body.model or self._models[k]
                body = replace(body, model=self._models[k])
            people.append(body)
        return tuple(people)


class LiveMultiView(LiveEstimator):
    """Several cameras, before which several people are followed, or one."""

    def __init__(self, rig: Rig, settings: Settings, people: int = 1):
        super().__init__(FollowedPeople, rig, settings, people)

    def prepare(self, moment: LiveMoment) -> Moment:
        """The silhouettes."""
        return moment.silhouettes


class FollowedPeople:
    """People before several cameras: see `PoseFollowers`; searches are made in other processes."""

    def __init__(self, rig: Rig, settings: Settings, people: int):
        """Loads all kernels, which takes seconds."""
        side = long_side_px(rig)
        self._lenses = {c.name: UndistortedView.from_camera(c, side) for c in rig}
        self._pinholes = Rig(tuple(lens.pinhole for lens in self._lenses.values()))
        self._executor = ProcessPoolExecutor(people, SPAWN, leave_interrupts, (1,))
        self._follower = PoseFollowers(self._pinholes, settings, people, self._executor)
        self._hulls: list[tuple[float, NDArray[np.float32]] | None] = [None] * people
        self._warm_up(settings)

    def step(self, moment: Moment) -> People:
        """Everybody in silhouettes as recorded; None where there is none."""
        masks = {name: self._lenses[name].undistort(mask) for name, mask in moment.masks().items()}
        people = self._follower.step(Moment.of(moment.time_s, masks))
        return tuple(self._posed_person(k, person) for k, person in enumerate(people))

    def _posed_person(self, number: int, person: FoundPerson | None) -> PosedBody | None:
        """Somebody who was found, with the hull, which is carved now and then."""
        if person is None:
            self._hulls[number] = None
            return None
        hull, time_s, pose = self._hulls[number], person.moment.time_s, person.fit.pose
        if hull is None or time_s - hull[0] > 0.15:  # it is only shown
            hull = self._hulls[number] = time_s, self._carved(person.moment, pose)
        confidence = float(np.clip(1 - person.fit.error, 0, 1))
        body = posed_body(person.model, pose, confidence, person.visibility, hull_m=hull[1])
        return replace(body, confidence=confidence * float(person.visibility.mean()))

    def close(self) -> None:
        """Ends the searching process."""
        self._executor.shutdown(wait=True, cancel_futures=True)

    def _warm_up(self, settings: Settings) -> None:
        """Follows a drawn body, so that all kernels are loaded before the first frame."""
        body = BodyModel.from_sizes(BodySizes(settings.stature_m or MEASURING.usual_m))
        silhouettes = _upright_masks(self._pinholes, body, load_backend(settings.backend))
        if sum(mask.any() for mask in silhouettes.values()) < 2:
            return
        moment = Moment.of(0.0, silhouettes)
        load = partial(_load_kernels, self._pinholes, settings, moment)
        loading = [self._executor.submit(load) for _ in self._hulls]
        load()
        for future in loading:
            future.result()

    def _carved(self, moment: Moment, pose: Pose) -> NDArray[np.float32]:
        low, high = pose.root_m - 1.2, pose.root_m + 1.2  # as far as a body reaches
        grid = VoxelGrid.from_bounds(low, high, CARVING.coarse_m)
        views, masks = moment.views(self._pinholes), moment.masks()
        rule = body_rule(len(masks), 0, views.partly_unknown)
        hull = carve(views.rig, masks, grid, rule, views.unknown)
        return grid.occupied_points(hull).astype(np.float32)


class _Untimed(StageClock):
    """Keeps no durations: a session may last for days."""

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        yield


class LiveMonocular(LiveEstimator):
    """One camera: the person here, poses in a process of their own."""

    def __init__(
        self,
        camera: Camera,
        settings: Settings,
        options: MonocularOptions,
        coloured: bool,
        reporter: Reporter,
    ):
        """Checks the options, whose library exists, and begins the process."""
        person_for(options, settings, reporter)  # here, where it is reported
        self._finder = PersonFinder(camera, coloured and not options.outline_only)
        self._name = camera.name
        super().__init__(MonocularPoses, camera, settings, options)

    def prepare(self, moment: LiveMoment) -> SeenPerson | None:
        """Person in a frame; None where it shows nobody."""
        mask = moment.silhouettes.masks()[self._name]
        person = self._finder.find(moment.pictures[self._name], mask)
        return None if person is None else (moment.number, moment.time_s, person)

    def step(self, given: SeenPerson | None) -> People:
        """See `LiveEstimator.step`."""
        return (None,) if given is None else super().step(given)


class MonocularPoses:
    """Poses of the person whom one camera sees."""

    def __init__(self, camera: Camera, settings: Settings, options: MonocularOptions):
        person = person_for(options, settings, SilentReporter())
        self._stages = PoseStages(person, camera, settings, options, _Untimed())

    def step(self, seen: SeenPerson) -> People:
        """The likeliest pose and others."""
        (estimate,) = self._stages.trajectory.add(self._stages.noted(*seen))
        model, confidence = self._stages.trajectory.model, float(np.clip(1 - estimate.error, 0, 1))
        visibility = np.where(estimate.occluded[model.tree.landmark_part], LIVE.occluded, 1.0)
        probabilities = estimate.probability[:_HYPOTHESES].tolist()
        hypotheses = tuple(zip(probabilities, estimate.joints[:_HYPOTHESES], strict=True))
        return (posed_body(model, estimate.pose, confidence, visibility, hypotheses),)

    def close(self) -> None:
        """Nothing was begun."""


class LiveTree(LiveMonocular):
    """One camera, by paper A's filter: see `TreeEstimator`."""

    def __init__(
        self,
        camera: Camera,
        settings: Settings,
        options: TreeOptions,
        fps: float,
        reporter: Reporter,
    ):
        """Builds the library where there is none, and begins the process."""
        library_of(_pitch(camera), settings, options, reporter)  # here, where it is reported
        self._finder, self._name = PersonFinder(camera, False), camera.name
        LiveEstimator.__init__(self, TreePoses, camera, settings, options, fps)


class TreePoses:
    """Likeliest samples of the person whom one camera sees."""

    def __init__(self, camera: Camera, settings: Settings, options: TreeOptions, fps: float):
        self._library = library_of(_pitch(camera), settings, options, SilentReporter())
        pinhole = UndistortedView.from_camera(camera, LONG_SIDE_PX).pinhole
        backend = load_backend(settings.backend)
        self._follower = TreeFollower(self._library, pinhole, options.start, 1 / fps, backend)

    def step(self, seen: SeenPerson) -> People:
        """The likeliest sample and others."""
        _, time_s, person = seen
        pose, error, probability, joints = self._follower.step(time_s, person.mask)
        hypotheses = tuple(zip(probability.tolist(), joints, strict=True))
        confidence = float(np.clip(1 - error, 0, 1))
        return (posed_body(self._library.model, pose, confidence, np.ones(15), hypotheses),)

    def close(self) -> None:
        """Nothing was begun."""


def _pitch(camera: Camera) -> float:
    """How far down a camera looks, z up, radians."""
    return -float(np.arcsin(camera.rotation[2, 2]))


def posed_body(
    model: BodyModel,
    pose: Pose,
    confidence: float,
    visibility: NDArray[np.float64],
    hypotheses: Hypotheses = (),
    hull_m: NDArray[np.float32] | None = None,
) -> PosedBody:
    """Body with its parts and joints in the world; `visibility`, (15,), is each joint's confidence
    relative to the pose's, 0 to 1, the rest as of `PosedBody`.
    """
    (rotation, *_), (origin, *_) = place(model, *PoseArrays.from_poses([pose]).arrays)
    (joints_m,) = centres_of(model, [pose])
    each = confidence * visibility
    return PosedBody(model, pose, rotation, origin, joints_m, each, confidence, hypotheses, hull_m)


def _load_kernels(rig: Rig, settings: Settings, moment: Moment) -> None:
    """Runs once all that is done to follow a body."""
    track = search(rig, settings, None, moment, 1)
    if track is not None:
        track = track.follow(rig, replace(moment, time_s=moment.time_s + 1 / FPS))
        search_limbs(rig, track, moment)
        adapt_body(rig, settings, track, [(moment, track.fit.pose)])


def _upright_masks(rig: Rig, body: BodyModel, backend: Backend) -> dict[str, NDArray[np.bool_]]:
    """Silhouettes (h, w) bool of an upright body at the point nearest to all optical axes."""
    axes = np.stack([camera.rotation[2] for camera in rig])
    middle = nearest_point(np.stack([camera.center_m for camera in rig]), axes)
    pose = Pose(middle, np.eye(3), np.zeros(body.dof_count))
    masks = body_masks(body, pose, PinholeViews.from_rig(rig), backend)
    return dict(zip(rig.names, masks, strict=True))
