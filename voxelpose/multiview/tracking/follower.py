"""One body followed through frames as they come: nothing later is known, and time is short.

Every frame refines the pose that the last ones predict. What takes longer than a frame (the search
for a pose without a prior, the search of arms and legs, the body's proportions) is done beside, on
one frame, and then catches up with the frames that have come since.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field

import numpy as np

from calib.camera import Rig
from silhouette_core.motion.pose import Pose
from voxelpose.multiview.carving.bounds import LEAST_CAMERAS
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.tracking.body_track import BodyTrack, Masks, Moment
from voxelpose.multiview.tracking.track_jobs import (
    FollowSettings,
    adapt_body,
    catch_up,
    search,
    search_limbs,
)
from voxelpose.multiview.tuning import LIVE, MATCHING, TRACKING

_Searched = Future[BodyTrack | None]


@dataclass
class _Followed:
    """What is remembered about one person.

    Attributes:
        least: least usual error so far.
        searched_s: when the last search to improve began.
        limbs_s: the same of the last search of arms and legs.
        samples: moments and poses to which the proportions are adapted.
        adapted: how often they have been.
    """

    least: float = np.inf
    searched_s: float = -np.inf
    limbs_s: float = -np.inf
    samples: list[tuple[Moment, Pose]] = field(default_factory=list)
    adapted: int = 0


class PoseFollower:
    """Follows one body.

    Args:
        rig: pinhole cameras, whose silhouettes are given.
        settings: what is known about the person.
        executor: does what takes longer than a frame, one job at a time.
    """

    def __init__(self, rig: Rig, settings: FollowSettings, executor: Executor):
        """Starts without a body."""
        self.rig, self.settings = rig, settings
        self._executor = executor
        self._track: BodyTrack | None = None
        self._lost: BodyTrack | None = None  # may be found again within a few frames
        self._known: BodyGeometry | None = None
        self._person = _Followed()
        self._job: _Searched | None = None
        self._since: list[Moment] = []
        self._previous_s = 0.0

    @property
    def body(self) -> BodyGeometry | None:
        """The body that is followed; None: there is none at present."""
        return None if self._track is None else self._track.body

    def step(self, time_s: float, masks: Masks) -> PoseFit | None:
        """Pose in the next frame, or None where nobody is found.

        Args:
            time_s: time of the frame.
            masks: silhouettes (h, w) bool by camera name, of two cameras at least; cameras that are
                missing at the moment are left out.
        """
        longest_s = max(LIVE.longest_gap_s, LIVE.longest_gap * (time_s - self._previous_s))
        self._previous_s = time_s
        latest, self._track = self._track or self._lost, None
        for track in (latest, self._found()):
            if track is not None and time_s - track.time_s <= longest_s:
                stepped = track.follow(self.rig, time_s, masks)
                best = self._track
                least = TRACKING.lost if best is None else TRACKING.better * best.fit.error
                if stepped.fit.error < least:
                    self._track = stepped
        self._lost = latest if self._track is None else None
        moment = Moment.of(time_s, masks)
        if self._job is None:
            self._begin_job(moment)
        else:
            self._since = [
                one for one in (*self._since, moment) if time_s - one.time_s < LIVE.forgotten_s
            ]
        return None if self._track is None else self._track.fit

    def _found(self) -> BodyTrack | None:
        """Track of a finished job, once it has caught up with the present."""
        if self._job is None or not self._job.done():
            return None
        job, self._job = self._job, None
        track = job.result()
        if track is None:
            return None
        later = [moment for moment in self._since if moment.time_s > track.time_s]
        if len(later) <= LIVE.caught_up:
            return track
        self._since = []
        self._submit(catch_up, self.rig, track, later)
        return None

    def _begin_job(self, moment: Moment) -> None:
        """Begins what is due, with the frame whose track is the present one."""
        self._since = []
        track, person, now = self._track, self._person, moment.time_s
        if track is None:
            area = (mask.mean() for mask in moment.masks().values())
            if sum(fraction > LIVE.foreground for fraction in area) >= LEAST_CAMERAS:
                first = moment, LIVE.first_placements
                self._submit(search, self.rig, self.settings, self._known, *first)
            return
        self._known = track.body
        person.least = min(person.least, track.usual)
        sampled_s = person.samples[-1][0].time_s if person.samples else -np.inf
        unfinished = person.adapted < len(LIVE.apart_s)
        poor = track.is_poor(track.fit.error)
        if unfinished and not poor and now - sampled_s > LIVE.apart_s[person.adapted]:
            person.samples.append((moment, track.fit.pose))
        suspect = track.usual > TRACKING.suspect
        bad = suspect or track.usual > TRACKING.bad * person.least
        limbs_again_s = LIVE.poor_again_s if poor else LIVE.limbs_again_s
        if bad and now - person.searched_s > LIVE.poor_again_s:
            person.searched_s = now
            body = None if suspect else track.body  # a wrong pose has spoiled the proportions
            self._submit(search, self.rig, self.settings, body, moment, MATCHING.placements)
        elif len(person.samples) >= LIVE.adapted:
            samples, person.samples = person.samples, []
            person.adapted += 1
            self._submit(adapt_body, self.rig, self.settings, track, samples)
        elif now - person.limbs_s > limbs_again_s:
            person.limbs_s = now
            self._submit(search_limbs, self.rig, track, moment)

    def _submit(self, work: Callable[..., BodyTrack | None], *arguments: object) -> None:
        self._job = self._executor.submit(work, *arguments)
