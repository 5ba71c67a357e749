"""One body followed through frames as they come: nothing later is known, and time is short.

Every frame refines the pose that the last ones predict. What takes longer than a frame (the search
for a pose without a prior, the search of arms and legs, the body's proportions) is done beside, on
one frame, and then catches up with the frames that have come since.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.bounds import LEAST_CAMERAS, place_grid
from voxelpose.multiview.carving.observe import FrameObservation, HullObserver, body_rule
from voxelpose.multiview.person.posterior import (
    GIRTH_CAMERAS,
    chest_from_hull,
    hull_height_m,
    hull_volume_m3,
    is_improbable,
    is_unusual,
)
from voxelpose.multiview.proposers.pose_search import (
    FEW_PLACEMENTS,
    PLACEMENTS,
    BodyGeometry,
    PoseFit,
    find_pose,
)
from voxelpose.multiview.tracking.body_track import (
    RECENT,
    BodyTrack,
    Moment,
    is_near,
    observed_near,
)
from voxelpose.multiview.tuning import CARVING, LIVE, PERSON_COST, TRACKING

_ADAPTED = 8  # frames to which proportions are adapted
_CAUGHT_UP = 2  # frames that may still be missing when a search has caught up
_FORGOTTEN_S = 6  # age after which the frames since a search began are forgotten
_MOST_WRONG = 5  # frames running, after which a track that catches up is given up


def search(
    rig: Rig, settings: Settings, body: BodyGeometry | None, moment: Moment, count: int
) -> BodyTrack | None:
    """Searches a pose without a prior; None where there is no body.

    Args:
        rig: pinhole cameras.
        body: the body; None: one as the settings say.
        count: placements of the torso to try.
    """
    frame = _hull(rig, moment)
    if frame is None:
        return None
    body = body or _body(settings, frame)
    fits = find_pose(body, frame, count=count)
    tracks = [BodyTrack(body, moment.time_s, fit) for fit in fits]
    if tracks and is_improbable([tracks[0].fit.error]):
        # Of another body than this one, the right pose need not be the one that fits best.
        tracks += [
            adapt_body(rig, settings, track, [(moment, track.fit.pose)]) for track in tracks[:3]
        ]
    return min(tracks, key=lambda track: track.fit.error, default=None)


def search_limbs(rig: Rig, track: BodyTrack, moment: Moment) -> BodyTrack | None:
    """Searches every arm and leg in the track's latest frame; None where none is better."""
    improved = track.with_limbs(observed_near(track.body, rig, moment, track.fit.pose))
    return None if improved is track else improved


def adapt_body(
    rig: Rig, settings: Settings, track: BodyTrack, samples: Sequence[tuple[Moment, Pose]]
) -> BodyTrack:
    """Track with a body whose proportions are adapted to some frames."""
    model = track.body.model
    stature = model.sizes.stature_m
    is_given = settings.stature_m is not None
    sigma = PERSON_COST.told_sigma_m if is_given else PERSON_COST.hull_sigma * stature
    observations = [observed_near(track.body, rig, moment, pose) for moment, pose in samples]
    surface, poses = adapt_shape(
        track.body.surface,
        observations,
        [pose for _, pose in samples],
        Stature(stature, sigma),
        model.shape,
    )
    body = BodyGeometry.from_surface(surface, CARVING.voxel_m, settings.backend)
    if samples[-1][0].time_s != track.time_s:
        return replace(track, body=body)
    error = silhouette_error(surface.model, poses[-1], observations[-1], body.body_volume.backend)
    return replace(track, body=body, fit=PoseFit(poses[-1], error))


def catch_up(rig: Rig, track: BodyTrack, moments: Sequence[Moment]) -> BodyTrack | None:
    """Track in the last of some moments that followed on its latest frame; None where it is lost.

    Where it suddenly fits worse, arms and legs are searched: they move farthest between frames, and
    what begins wrong here is followed wrong.

    Args:
        moments: in order; some are passed over, as long as no step becomes long.
    """
    usual, waiting, searched, wrong = track.usual, list(moments), False, 0
    while waiting:
        near = [one for one in waiting[:2] if one.time_s - track.time_s < LIVE.longest_step_s]
        moment = near[-1] if len(near) == 2 and len(waiting) > 2 else waiting[0]
        waiting = [one for one in waiting if one.time_s > moment.time_s]
        track = followed(rig, track, moment)
        if is_unusual(track.fit.error, usual) and not searched:
            searched, track = True, search_limbs(rig, track, moment) or track
        error = track.fit.error
        wrong = wrong + 1 if is_improbable([error]) and is_unusual(error, usual) else 0
        if track.fit.error > TRACKING.lost or wrong == _MOST_WRONG:
            return None
    return track


def followed(rig: Rig, track: BodyTrack, moment: Moment) -> BodyTrack:
    """Track with the next frame of pinhole cameras. Where few frames come, the person has gone
    farther than a step reaches: then also from where the silhouettes are now.
    """
    near = track.follow(rig, moment)
    if is_near(track.time_s, moment.time_s) or not track.is_poor(near.fit.error):
        return near
    frame = _hull(rig, moment)
    if frame is None:
        return near
    pose, points_m = track.fit.pose, track.body.surface.posed(track.fit.pose).points
    offset_m = frame.grid.occupied_points(frame.occupancy).mean(0) - points_m.mean(0)
    moved = replace(pose, root_m=pose.root_m + offset_m * (1, 1, 0))
    moved_track = replace(track, before=None, fit=replace(track.fit, pose=moved))
    far = replace(moved_track.follow(rig, moment), before=(track.time_s, pose))
    return min(near, far, key=lambda one: one.fit.error)


def _body(settings: Settings, frame: FrameObservation) -> BodyGeometry:
    """Body of the stature and chest girth given, or of the hull's height and volume."""
    stature = settings.stature_m
    if stature is None:
        stature = float(np.clip(hull_height_m(frame), 0.6, 2.4))
    sex = "male" if settings.sex == "unknown" else settings.sex
    model = BodyModel.from_sizes(BodySizes(stature, settings.chest_m, sex))
    if settings.chest_m is None and len(frame.masks) >= GIRTH_CAMERAS:
        chest = chest_from_hull(model, hull_volume_m3(frame))
        model = BodyModel.from_sizes(BodySizes(stature, chest, sex))
    return BodyGeometry.from_surface(Surface(model), CARVING.voxel_m, settings.backend)


def _hull(rig: Rig, moment: Moment) -> FrameObservation | None:
    """Silhouettes of one body and its hull; None where they do not meet in space."""
    views, images = moment.views(rig), list(moment.masks().values())
    rule = body_rule(len(images), 0, views.partly_unknown)
    try:
        grid = place_grid(views.rig, images, CARVING.coarse_m, rule=rule, unknown=views.unknown)
    except InputError:
        return None
    return HullObserver(views, grid, CARVING.voxel_m, rule).observe(images)


_Searched = Future[BodyTrack | None]


@dataclass
class _Followed:
    """What is remembered about one person."""

    least: float = np.inf  #: least usual error so far.
    searched_s: float = -np.inf  #: when the last search to improve began.
    limbs_s: float = -np.inf  #: the same of the last search of arms and legs.
    samples: list[tuple[Moment, Pose]] = field(default_factory=list)
    """Moments and poses to which the proportions are adapted."""
    adapted: int = 0  #: how often they have been.


class PoseFollower:
    """Follows one body with pinhole cameras; the executor does one long job at a time.

    Attributes:
        rough: whether the silhouettes of the first search showed something else, too, so that it is
            made again as soon as a body is followed.
    """

    def __init__(self, rig: Rig, settings: Settings, executor: Executor):
        """Starts without a body."""
        self.rig, self.settings = rig, settings
        self._executor = executor
        self._track: BodyTrack | None = None
        self._lost: BodyTrack | None = None  # may be found again within a few frames
        self._known: BodyGeometry | None = None
        self._person = _Followed()
        self._job: _Searched | None = None
        self._since: list[Moment] = []
        self._missed = 0  # frames since the last pose
        self._previous_s = 0.0
        self.rough = False

    @property
    def body(self) -> BodyGeometry | None:
        """The body that is followed; None: there is none at present."""
        return None if self._track is None else self._track.body

    @property
    def busy(self) -> bool:
        """Whether a long job was begun, and its result is not taken yet."""
        return self._job is not None

    @property
    def expected(self) -> BodyTrack | None:
        """Track that may go on, perhaps after some frames without a pose."""
        return self._track or self._lost

    def step(self, moment: Moment) -> PoseFit | None:
        """Pose in the next frame, of two cameras at least, or None where nobody is found; cameras
        that are missing at the moment are left out.
        """
        time_s, previous_s = moment.time_s, self._previous_s
        latest, self._track, self._previous_s = self.expected, None, time_s
        searched, later = self._found()
        behind = len(later) > _CAUGHT_UP
        if searched is not None and behind and is_near(previous_s, time_s):
            self._catch_up(searched, later)
            searched = None
        for track in (latest, searched):
            if track is not None:
                stepped = followed(self.rig, track, moment)
                best = self._track
                least = TRACKING.lost if best is None else best.fit.error
                if stepped.fit.error < least:
                    self._track = stepped
        if searched is not None and behind and self._track is None:
            self._catch_up(searched, later)
        self._missed = 0 if self._track is not None else self._missed + 1
        self._lost = latest if 0 < self._missed <= RECENT else None
        if self._job is None:
            self._begin_job(moment)
        else:
            self._since = [
                one for one in (*self._since, moment) if time_s - one.time_s < _FORGOTTEN_S
            ]
        return None if self._track is None else self._track.fit

    def _found(self) -> tuple[BodyTrack | None, list[Moment]]:
        """Track of a finished job, None where there is none, and the moments that have come since
        its frame.
        """
        if self._job is None or not self._job.done():
            return None, []
        job, self._job = self._job, None
        track = job.result()
        if track is None:
            return None, []
        return track, [moment for moment in self._since if moment.time_s > track.time_s]

    def _catch_up(self, track: BodyTrack, later: list[Moment]) -> None:
        """Begins to follow a track through the moments that have come since."""
        self._since = []
        self._submit(catch_up, self.rig, track, later)

    def _begin_job(self, moment: Moment) -> None:
        """Begins what is due, with the frame whose track is the present one."""
        self._since = []
        track, person, now = self._track, self._person, moment.time_s
        if track is None:
            area = (mask.mean() for mask in moment.masks().values())
            if sum(fraction > LIVE.foreground for fraction in area) >= LEAST_CAMERAS:
                self._submit(search, self.rig, self.settings, self._known, moment, FEW_PLACEMENTS)
            return
        self._known = track.body
        person.least = min(person.least, track.usual)
        sampled_s = person.samples[-1][0].time_s if person.samples else -np.inf
        unfinished = person.adapted < len(LIVE.apart_s)
        poor = track.is_poor(track.fit.error)
        if unfinished and not poor and now - sampled_s > LIVE.apart_s[person.adapted]:
            person.samples.append((moment, track.fit.pose))
        suspect = self.rough or is_improbable([track.usual])
        bad = suspect or is_unusual(track.usual, person.least)
        limbs_again_s = LIVE.poor_again_s if poor else LIVE.limbs_again_s
        if bad and now - person.searched_s > LIVE.poor_again_s:
            person.searched_s, self.rough = now, False
            body = None if suspect else track.body  # a wrong pose has spoiled the proportions
            self._submit(search, self.rig, self.settings, body, moment, PLACEMENTS)
        elif len(person.samples) >= _ADAPTED:
            samples, person.samples = person.samples, []
            person.adapted += 1
            self._submit(adapt_body, self.rig, self.settings, track, samples)
        elif now - person.limbs_s > limbs_again_s:
            person.limbs_s = now
            self._submit(search_limbs, self.rig, track, moment)

    def _submit(self, work: Callable[..., BodyTrack | None], *arguments: object) -> None:
        self._job = self._executor.submit(work, *arguments)
