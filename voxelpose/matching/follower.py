"""One body followed through frames as they come: nothing later is known, and time is short.

Every frame refines the pose that the last ones predict. What takes longer than a frame (the search
for a pose without a prior, the search of arms and legs, the body's proportions) is done in a second
thread on one frame, and then catches up with the frames that have come since.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.dynamics import FPS, MOMENTUM, POSE_STEP_SIGMA
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.refine import PosePrior, RefineSettings
from silhouette_core.refinement.surface import Surface
from voxelpose.carving.bounds import place_grid
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import FrameObservation, HullObserver, body_rule
from voxelpose.matching.pose_search import BodyGeometry, PoseFit, find_pose, move_limbs, refine_fit

Masks = Mapping[str, NDArray[np.bool_]]

_FOLLOW = RefineSettings(reaches_m=(0.18, 0.12, 0.08, 0.06))
_CATCH_UP = RefineSettings(reaches_m=(0.30, 0.25, 0.20, 0.15, 0.12, 0.10, 0.08))
_SPACING_M = 0.05  # between contour points: half as many as off line
_VOXEL_M = 0.025
_FIRST_PLACEMENTS, _PLACEMENTS = 4, 10  # of the torso, in a first search and in one to improve
_LOST = 0.45  # largest error of a pose that is kept
_LONGEST_GAP_S = 0.5
_BETTER = 0.97  # a track replaces another where its error is below this fraction of the other's
_RECENT = 12  # frames whose median error is the usual one
_POOR, _POOR_BY = 1.2, 0.01  # factor, and excess, over the usual error that make a frame poor
_BAD, _BAD_BY = 1.4, 0.03  # the same over the least usual error, which make a search due
_SEARCH_AGAIN_S, _LIMBS_AGAIN_S = 2.0, 1.5
_NEAR_M, _REDUCED = 0.30, 8
_ADAPTED, _APART_S = 8, 0.4  # frames to which proportions are adapted, and the time between them
_GIVEN_SIGMA_M, _HULL_SIGMA = 0.006, 0.05
_FOREGROUND = 0.002  # least fraction of a picture that a person takes


@dataclass(frozen=True)
class FollowSettings:
    """What is known about the person.

    Attributes:
        stature_m: height; None: estimated from the hull.
        chest_m: chest girth; None: usual for the stature.
        sex: which decides the proportions.
    """

    stature_m: float | None = None
    chest_m: float | None = None
    sex: str = "unknown"


@dataclass(frozen=True, eq=False)
class _Moment:
    """Silhouettes of one moment, packed."""

    time_s: float
    bits: dict[str, tuple[NDArray[np.uint8], int]]

    @classmethod
    def of(cls, time_s: float, masks: Masks) -> _Moment:
        packed = {name: (np.packbits(mask, axis=1), mask.shape[1]) for name, mask in masks.items()}
        return cls(time_s, packed)

    def masks(self) -> dict[str, NDArray[np.bool_]]:
        return {
            name: np.unpackbits(bits, axis=1, count=width).view(bool)
            for name, (bits, width) in self.bits.items()
        }


@dataclass(frozen=True, eq=False)
class _Track:
    """A body and its latest poses.

    Attributes:
        body: the body.
        time_s: of the latest frame.
        fit: its pose and error.
        before: time and pose of the frame before it.
        errors: of recent frames.
    """

    body: BodyGeometry
    time_s: float
    fit: PoseFit
    before: tuple[float, Pose] | None = None
    errors: tuple[float, ...] = ()

    @property
    def usual(self) -> float:
        return float(np.median(self.errors)) if self.errors else self.fit.error

    def predicted(self, time_s: float) -> Pose:
        """Pose expected at a damped constant velocity."""
        if self.before is None:
            return self.fit.pose
        before_s, before = self.before
        ahead = MOMENTUM * (time_s - self.time_s) / max(self.time_s - before_s, 1e-3)
        return self.fit.pose.moved(min(ahead, 3.0) * self.fit.pose.minus(before)).clipped()

    def then(self, time_s: float, fit: PoseFit) -> _Track:
        errors = (*self.errors[1 - _RECENT :], fit.error)
        return _Track(self.body, time_s, fit, (self.time_s, self.fit.pose), errors)


@dataclass
class _Followed:
    """What is remembered about one person.

    Attributes:
        least: least usual error so far.
        searched_s: when the last search ended.
        limbs_s: the same of the last search of arms and legs.
        samples: moments and poses to which the proportions are adapted.
        adapted: whether they have been.
    """

    least: float = np.inf
    searched_s: float = -np.inf
    limbs_s: float = -np.inf
    samples: list[tuple[_Moment, Pose]] = field(default_factory=list)
    adapted: bool = False


class PoseFollower:
    """Follows one body.

    Args:
        rig: pinhole cameras, whose silhouettes are given.
        settings: what is known about the person.
        executor: runs what takes longer than a frame; one job at a time is given to it.
    """

    def __init__(self, rig: Rig, settings: FollowSettings, executor: Executor):
        """Starts without a body."""
        self.rig, self.settings = rig, settings
        self._executor = executor
        self._views: dict[tuple[str, ...], PinholeViews] = {}
        self._track: _Track | None = None
        self._known: BodyGeometry | None = None
        self._person = _Followed()
        self._job: Future[_Track | None] | None = None
        self._since: deque[_Moment] = deque()

    @property
    def body(self) -> BodyGeometry | None:
        """The body, once there is one."""
        return None if self._track is None else self._track.body

    def step(self, time_s: float, masks: Masks) -> PoseFit | None:
        """Pose in the next frame, or None where nobody is found.

        Args:
            time_s: time of the frame.
            masks: silhouettes (h, w) bool by camera name, of two cameras at least; cameras that are
                missing at the moment are left out.
        """
        found = self._finished()
        tracks = [track for track in (self._track, found) if track is not None]
        self._track = None
        for track in tracks:
            if time_s - track.time_s <= _LONGEST_GAP_S:
                followed = self._follow(track, time_s, masks, _FOLLOW)
                least = np.inf if self._track is None else _BETTER * self._track.fit.error
                if followed.fit.error < min(least, _LOST):
                    self._track = followed
        if self._job is None:
            self._begin_job(_Moment.of(time_s, masks), masks)
        else:
            self._since.append(_Moment.of(time_s, masks))
        return None if self._track is None else self._track.fit

    def _follow(
        self, track: _Track, time_s: float, masks: Masks, settings: RefineSettings
    ) -> _Track:
        views, body = self._views_of(masks), track.body
        predicted = track.predicted(time_s)
        interval = float(np.clip((time_s - track.time_s) * FPS, 0.3, 3.0))
        observation = _near(body, views, masks, predicted)
        prior = PosePrior(predicted, POSE_STEP_SIGMA * interval)
        return track.then(time_s, refine_fit(body, observation, predicted, prior, settings))

    def _views_of(self, masks: Masks) -> PinholeViews:
        names = tuple(masks)
        if names not in self._views:
            self._views[names] = PinholeViews.from_rig(self.rig.select(list(names)))
        return self._views[names]

    def _finished(self) -> _Track | None:
        """Track that a finished job found."""
        if self._job is None or not self._job.done():
            return None
        job, self._job = self._job, None
        return job.result()

    def _begin_job(self, moment: _Moment, masks: Masks) -> None:
        track, person = self._track, self._person
        self._since.clear()
        if track is None:
            if sum(mask.mean() > _FOREGROUND for mask in masks.values()) >= 2:
                self._job = self._executor.submit(self._search, moment, _FIRST_PLACEMENTS)
            return
        self._known = track.body
        person.least = min(person.least, track.usual)
        if not person.samples or moment.time_s - person.samples[-1][0].time_s > _APART_S:
            if track.fit.error < 1.1 * track.usual and not person.adapted:
                person.samples.append((moment, track.fit.pose))
        limbs_due = moment.time_s - person.limbs_s > _LIMBS_AGAIN_S
        if (
            track.usual > max(_BAD * person.least, _BAD_BY + person.least)
            or person.searched_s == -np.inf
        ) and moment.time_s - person.searched_s > _SEARCH_AGAIN_S:
            person.searched_s = moment.time_s
            self._job = self._executor.submit(self._search, moment, _PLACEMENTS)
        elif not person.adapted and len(person.samples) >= _ADAPTED:
            person.adapted = True
            self._job = self._executor.submit(self._adapt, track, list(person.samples))
        elif limbs_due or track.fit.error > _POOR * track.usual + _POOR_BY:
            person.limbs_s = moment.time_s
            self._job = self._executor.submit(self._move_limbs, track, moment)

    def _search(self, moment: _Moment, count: int) -> _Track | None:
        """Searches a pose without a prior."""
        masks = moment.masks()
        frame = _hull(self._views_of(masks), list(masks.values()))
        if frame is None:
            return None
        body = self._known or _body(self.settings, frame)
        fits = find_pose(body, frame, MatchSettings(), count)
        return self._caught_up(_Track(body, moment.time_s, fits[0])) if fits else None

    def _move_limbs(self, track: _Track, moment: _Moment) -> _Track | None:
        """Searches every arm and leg."""
        masks = moment.masks()
        observation = _near(track.body, self._views_of(masks), masks, track.fit.pose)
        moved = move_limbs(track.body, observation, track.fit)
        better = moved.error < _BETTER * track.fit.error
        return self._caught_up(replace(track, fit=moved)) if better else None

    def _adapt(self, track: _Track, samples: list[tuple[_Moment, Pose]]) -> _Track | None:
        """Adapts the body's proportions to some frames."""
        model = track.body.model
        given = self.settings.stature_m is not None
        stature = model.sizes.stature_m
        sigma = _GIVEN_SIGMA_M if given else _HULL_SIGMA * stature
        observations = []
        for moment, pose in samples:
            masks = moment.masks()
            observations.append(_near(track.body, self._views_of(masks), masks, pose))
        surface, _ = adapt_shape(
            track.body.surface,
            observations,
            [pose for _, pose in samples],
            Stature(stature, sigma),
            model.shape,
        )
        body = BodyGeometry.from_surface(surface, _VOXEL_M)
        return self._caught_up(replace(track, body=body))

    def _caught_up(self, track: _Track) -> _Track | None:
        """Track in the latest frame that has come since the job began."""
        settings = _CATCH_UP
        while self._since:
            moment = self._since.popleft()
            track = self._follow(track, moment.time_s, moment.masks(), settings)
            settings = _FOLLOW
            if track.fit.error > _LOST:
                return None
        return track


def _body(settings: FollowSettings, frame: FrameObservation) -> BodyGeometry:
    """Body of the stature given, or of the hull's height."""
    stature = settings.stature_m
    if stature is None:
        rows = np.flatnonzero(frame.occupancy.any((0, 1)))
        stature = float(np.clip((np.ptp(rows) + 1) * frame.grid.voxel_size_m, 0.6, 2.4))
    sex = "male" if settings.sex == "unknown" else settings.sex
    model = BodyModel.from_sizes(BodySizes(stature, settings.chest_m, sex))
    return BodyGeometry.from_surface(Surface(model), _VOXEL_M)


def _hull(views: PinholeViews, masks: list[NDArray[np.bool_]]) -> FrameObservation | None:
    rule = body_rule(len(masks), 0)
    try:
        grid = place_grid(views.rig, masks, voxel_size_m=2 * _VOXEL_M, rule=rule)
    except InputError:  # the silhouettes do not meet in space
        return None
    return HullObserver(views, grid, _VOXEL_M, rule).observe(masks)


def _near(body: BodyGeometry, views: PinholeViews, masks: Masks, pose: Pose) -> Observation:
    """Silhouettes without what is farther from a pose than a limb moves in a frame."""
    points = body.surface.posed(pose).points[::4]
    near = []
    for c, mask in enumerate(masks.values()):
        inside = points @ views.rotation[c].T + views.translation_m[c]
        depth = np.maximum(inside[:, 2], 0.1)
        focal, center = views.intrinsics[c, :2], views.intrinsics[c, 2:]
        height, width = mask.shape
        small = np.zeros((-(-height // _REDUCED), -(-width // _REDUCED)), np.uint8)
        pixels = (inside[:, :2] / depth[:, None] * focal + center) / _REDUCED
        x, y = np.clip(pixels, 0, np.array(small.shape[::-1]) - 1).astype(int).T
        small[y, x] = 1
        reach = max(round(_NEAR_M * focal[0] / float(np.median(depth)) / _REDUCED), 1)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        size = small.shape[1] * _REDUCED, small.shape[0] * _REDUCED
        whole = cv2.resize(cv2.dilate(small, disc), size, interpolation=cv2.INTER_NEAREST)
        near.append(mask & whole[:height, :width].view(bool))
    distance = float(np.median(np.linalg.norm(views.center_m - pose.root_m, axis=1)))
    return Observation.from_masks(views, near, distance, _SPACING_M)
