"""Several people followed through frames as they come, each beside the others, who are drawn."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from calib.camera import Camera, Rig
from calib.checks import BoolArray, FloatArray, IntArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import load_backend
from silhouette_core.scoring.silhouette_error import body_masks
from voxelpose.multiview.carving.bounds import LEAST_CAMERAS, place_grid
from voxelpose.multiview.carving.observe import HullObserver, body_rule
from voxelpose.multiview.people import PEOPLE_CAMERAS
from voxelpose.multiview.people.own_silhouettes import Masks, hull_pieces, own_and_unknown
from voxelpose.multiview.people.presence import ASKED_HZ, HIDDEN_S, PresenceSearch, moving_costs
from voxelpose.multiview.proposers.pose_search import PoseFit
from voxelpose.multiview.tracking.body_track import BodyTrack, Moment
from voxelpose.multiview.tracking.follower import PoseFollower
from voxelpose.multiview.tuning import CARVING, LIVE, PEOPLE


@dataclass(frozen=True, eq=False)
class FoundPerson:
    """Somebody in a frame.

    Attributes:
        moment: the silhouettes that are the person's, and where nothing is known of them.
        visibility: (15,) float64, from 0 to 1: whether as many cameras see a joint as bound a hull.
    """

    model: BodyModel
    fit: PoseFit
    moment: Moment
    visibility: FloatArray


class PoseFollowers:
    """Follows N people with pinhole cameras; the executor does one long job at a time.

    Attributes:
        people: what follows each: a person keeps the number.
    """

    def __init__(self, rig: Rig, settings: Settings, people: int, executor: Executor):
        """Starts without anybody."""
        if people > 1:
            settings = settings.of_anybody
        self.people = [PoseFollower(rig, settings, executor) for _ in range(people)]
        self._rig, self._backend = rig, load_backend(settings.backend)
        self._places_m = np.full((people, 2), np.nan)  # where each was last; NaN: nowhere yet
        self._seen_s = np.full(people, -np.inf)  # and when
        self._there = np.zeros(people, np.bool_)  # who is in the present frame, as far as is known
        self._asked_s = -np.inf
        self._observer: HullObserver | None = None

    def step(self, moment: Moment) -> list[FoundPerson | None]:
        """Everybody by number in the next frame; None where somebody is not found."""
        if len(self.people) == 1:
            return [_found(self.people[0], moment, self._rig)]
        time_s, views, masks = moment.time_s, moment.views(self._rig), [*moment.masks().values()]
        tracks = [one.expected for one in self.people]
        for k, track in enumerate(tracks):
            if track is not None:
                self._note(k, track.fit.pose.root_m[:2], track.time_s)
        self._look(time_s, views, masks, [track is None for track in tracks])
        pieces, people = self._pieces(views, masks, time_s, tracks), []
        for k, (one, track) in enumerate(zip(self.people, tracks, strict=True)):
            # A search has all that may be the person's, by which the stature is told; the steps
            # that follow only what is nobody else's.
            bodies = track is not None or one.busy
            one.rough |= not bodies
            silhouettes, unknown = own_and_unknown(masks, pieces, k, bodies=bodies)
            if pieces[k] is None:
                silhouettes = [np.zeros_like(mask) for mask in masks]
            part = Moment.of(
                time_s,
                *(dict(zip(moment.bits, seen, strict=True)) for seen in (silhouettes, unknown)),
            )
            people.append(person := _found(one, part, self._rig))
            if person is not None:
                pieces[k] = body_masks(person.model, person.fit.pose, views, self._backend)
        return people

    def _pieces(
        self, views: PinholeViews, masks: Masks, time_s: float, tracks: Sequence[BodyTrack | None]
    ) -> list[Masks | None]:
        """Where each is seen, by the body as expected, or by the hull about the place."""
        drawn = [
            track and body_masks(track.body.model, track.predict(time_s).pose, views, self._backend)
            for track in tracks
        ]
        sought = [track is None for track in tracks] & self._there
        if self._observer is None or not sought.any():
            return drawn
        hulls = hull_pieces(
            masks, np.where(self._there[:, None], self._places_m, np.nan), self._observer
        )
        return [hull if new else body for body, hull, new in zip(drawn, hulls, sought, strict=True)]

    def _look(
        self, time_s: float, views: PinholeViews, masks: Masks, missing: Sequence[bool]
    ) -> None:
        """Looks for places of those who are missing, and decides who is where."""
        lost = np.flatnonzero(missing)
        again_s = 1 / ASKED_HZ if self._there[lost].any() else LIVE.poor_again_s
        if not len(lost) or len(masks) < PEOPLE_CAMERAS or time_s - self._asked_s < again_s:
            return
        self._asked_s = time_s
        axes_m, upright = self._free(views, masks, np.flatnonzero(~np.array(missing)))
        costs = np.full((len(lost), len(axes_m)), 2 * PEOPLE.appearing)
        for row, k in zip(costs, lost, strict=True):
            if np.isfinite(self._seen_s[k]):
                last_m, gone_s = self._places_m[k : k + 1], time_s - self._seen_s[k]
                row[:] = moving_costs(last_m, axes_m, gone_s)[0]
        # Who comes in stands or sits; who is there may lie down.
        stays = (costs[self._there[lost]] < 2 * PEOPLE.appearing).any(axis=0)
        axes_m, costs = axes_m[upright | stays], costs[:, upright | stays]
        for row, column in zip(*linear_sum_assignment(costs), strict=True):
            self._note(int(lost[row]), axes_m[column], time_s)
        self._there[lost] &= time_s - self._seen_s[lost] <= HIDDEN_S

    def _note(self, person: int, place_m: FloatArray, time_s: float) -> None:
        """Notes where somebody is."""
        self._places_m[person], self._seen_s[person], self._there[person] = place_m, time_s, True

    def _free(
        self, views: PinholeViews, masks: Masks, others: IntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Places (n, 2) of people whom nobody follows, and whether (n,) they are upright."""
        rule = body_rule(len(masks), 0)
        try:
            volume = place_grid(views.rig, masks, CARVING.coarse_m, rule=rule)
        except InputError:
            return np.empty((0, 2)), np.empty(0, np.bool_)
        self._observer = HullObserver(views, volume, CARVING.voxel_m, rule)
        sets = PresenceSearch(self._observer).sets(masks, len(self.people))
        best = sets.members[0]
        distances = np.linalg.norm(sets.axes_m[best][:, None] - self._places_m[others], axis=2)
        free = best[(distances > PEOPLE.reach_m).all(axis=1)]
        return sets.axes_m[free], sets.upright[free]


def _found(one: PoseFollower, moment: Moment, rig: Rig) -> FoundPerson | None:
    """Somebody followed in the next frame."""
    fit, body = one.step(moment), one.body
    if fit is None or body is None:
        return None
    (joints_m,) = joints_of(body.model, [fit.pose])
    visibility, views = np.ones(len(joints_m)), moment.views(rig)
    if views.unknown is not None:
        seen = [
            _is_seen(camera, joints_m, hidden)
            for camera, hidden in zip(views.rig, views.unknown, strict=True)
        ]
        visibility = np.minimum(np.sum(seen, axis=0) / LEAST_CAMERAS, 1)
    return FoundPerson(body.model, fit, moment, visibility)


def _is_seen(camera: Camera, points_m: FloatArray, unknown: BoolArray) -> BoolArray:
    """(n,) whether points (n, 3) are in a camera's picture, and where something is known."""
    pixels, _ = camera.project(points_m)
    column, row = np.rint(pixels).astype(int).T
    height, width = unknown.shape
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return inside & ~unknown[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
