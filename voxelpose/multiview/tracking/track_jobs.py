"""What takes longer than a frame: finding a body, its limbs, its proportions; catching up.

Functions of their arguments alone, so that another process can do them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.observe import FrameObservation, HullObserver, body_rule
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit, find_pose
from voxelpose.multiview.person.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3
from voxelpose.multiview.tracking.body_track import (
    BodyTrack,
    Masks,
    Moment,
    observed_near,
    views_of,
)
from voxelpose.multiview.tuning import CARVING, LIVE, PERSON_COST, TRACKING


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


def search(
    rig: Rig, settings: FollowSettings, body: BodyGeometry | None, moment: Moment, count: int
) -> BodyTrack | None:
    """Searches a pose without a prior; None where there is no body.

    Args:
        rig: pinhole cameras.
        settings: what is known about the person.
        body: the body; None: one as the settings say.
        moment: the silhouettes.
        count: placements of the torso to try.
    """
    frame = _hull(rig, moment.masks())
    if frame is None:
        return None
    body = body or _body(settings, frame)
    fits = find_pose(body, frame, count=count)
    tracks = [BodyTrack(body, moment.time_s, fit) for fit in fits]
    if tracks and tracks[0].fit.error > TRACKING.suspect:
        # Of another body than this one, the right pose need not be the one that fits best.
        tracks += [
            adapt_body(rig, settings, track, [(moment, track.fit.pose)]) for track in tracks[:3]
        ]
    return min(tracks, key=lambda track: track.fit.error, default=None)


def search_limbs(rig: Rig, track: BodyTrack, moment: Moment) -> BodyTrack | None:
    """Searches every arm and leg in the track's latest frame; None where none is better."""
    found = track.with_limbs(observed_near(track.body, rig, moment.masks(), track.fit.pose))
    return None if found is track else found


def adapt_body(
    rig: Rig,
    settings: FollowSettings,
    track: BodyTrack,
    samples: Sequence[tuple[Moment, Pose]],
) -> BodyTrack:
    """Track with a body whose proportions are adapted to some frames.

    Args:
        rig: pinhole cameras.
        settings: which say whether the stature was given.
        track: the track.
        samples: frames and their poses.
    """
    model = track.body.model
    stature = model.sizes.stature_m
    told = settings.stature_m is not None
    sigma = PERSON_COST.told_sigma_m if told else PERSON_COST.hull_sigma * stature
    observations = [
        observed_near(track.body, rig, moment.masks(), pose) for moment, pose in samples
    ]
    surface, poses = adapt_shape(
        track.body.surface,
        observations,
        [pose for _, pose in samples],
        Stature(stature, sigma),
        model.shape,
    )
    body = BodyGeometry.from_surface(surface, CARVING.voxel_m)
    if samples[-1][0].time_s != track.time_s:
        return replace(track, body=body)
    error = silhouette_error(surface.model, poses[-1], observations[-1], body.body_volume.backend)
    return replace(track, body=body, fit=PoseFit(poses[-1], error))


def catch_up(rig: Rig, track: BodyTrack, moments: Sequence[Moment]) -> BodyTrack | None:
    """Track in the last of some moments that followed on its latest frame; None where it is lost.

    Where it suddenly fits worse, arms and legs are searched: they move farthest between frames, and
    what begins wrong here is followed wrong.

    Args:
        rig: pinhole cameras.
        track: the track.
        moments: in order; some are passed over, as long as no step becomes long.
    """
    usual, waiting, searched, wrong = track.usual, list(moments), False, 0
    while waiting:
        near = [one for one in waiting[:2] if one.time_s - track.time_s < LIVE.longest_step_s]
        moment = near[-1] if len(near) == 2 and len(waiting) > 2 else waiting[0]
        waiting = [one for one in waiting if one.time_s > moment.time_s]
        track = track.follow(rig, moment.time_s, moment.masks())
        if track.fit.error > TRACKING.bad * usual and not searched:
            searched, track = True, search_limbs(rig, track, moment) or track
        wrong = wrong + 1 if track.fit.error > max(TRACKING.suspect, TRACKING.bad * usual) else 0
        if track.fit.error > TRACKING.lost or wrong == LIVE.most_wrong:
            return None
    return track


def _body(settings: FollowSettings, frame: FrameObservation) -> BodyGeometry:
    """Body of the stature and chest girth given, or of the hull's height and volume."""
    stature = settings.stature_m
    if stature is None:
        rows = np.flatnonzero(frame.occupancy.any((0, 1)))
        stature = float(np.clip((np.ptp(rows) + 1) * frame.grid.voxel_size_m, 0.6, 2.4))
    sex = "male" if settings.sex == "unknown" else settings.sex
    model = BodyModel.from_sizes(BodySizes(stature, settings.chest_m, sex))
    if settings.chest_m is None and len(frame.masks) >= GIRTH_CAMERAS:
        chest = chest_from_hull(model, hull_volume_m3(frame))
        model = BodyModel.from_sizes(BodySizes(stature, chest, sex))
    return BodyGeometry.from_surface(Surface(model), CARVING.voxel_m)


def _hull(rig: Rig, masks: Masks) -> FrameObservation | None:
    """Silhouettes of one body and its hull; None where they do not meet in space."""
    views, images = views_of(rig, tuple(masks)), list(masks.values())
    rule = body_rule(len(images), 0)
    try:
        grid = place_grid(views.rig, images, voxel_size_m=CARVING.coarse_m, rule=rule)
    except InputError:
        return None
    return HullObserver(views, grid, CARVING.voxel_m, rule).observe(images)
