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
from silhouette_core.refinement.refine import RefineSettings
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.multiview.carving.bounds import place_grid
from voxelpose.multiview.carving.observe import FrameObservation, HullObserver, body_rule
from voxelpose.multiview.matching.matcher import match
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit, move_limbs, refine_fit
from voxelpose.multiview.matching.torso_search import find_torso
from voxelpose.multiview.person.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3
from voxelpose.multiview.tracking.body_track import (
    STEP,
    BodyTrack,
    Masks,
    Moment,
    observation_at,
    observed_near,
    views_of,
)

LOST = 0.45
"""Largest error of a pose that is kept."""
BETTER = 0.97
"""A pose replaces another where its error is below this fraction of the other's."""
SUSPECT = 0.16
"""Error above which a pose may be a wrong one, or the body another."""
_VOXEL_M = 0.025
_LONGEST_STEP_S = 0.14  # to which frames are passed over
_SUDDEN, _SUDDEN_BY, _MOST_SEARCHES, _MOST_WRONG = 1.5, 0.03, 1, 5
_FIRST_STEP = RefineSettings(reaches_m=(0.30, 0.25, 0.20, 0.15, 0.12, 0.10, 0.08))
_GIVEN_SIGMA_M, _HULL_SIGMA = 0.006, 0.05


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
    masks = moment.masks()
    frame = _hull(rig, masks)
    if frame is None:
        return None
    body = body or _body(settings, frame)
    fits = _first_poses(body, frame, count)
    tracks = [BodyTrack(body, moment.time_s, fit) for fit in fits]
    if tracks and tracks[0].fit.error > SUSPECT:
        # Of another body than this one, the right pose need not be the one that fits best.
        tracks += [
            adapt_body(rig, settings, track, [(moment, track.fit.pose)]) for track in tracks[:3]
        ]
    return min(tracks, key=lambda track: track.fit.error, default=None)


def search_limbs(rig: Rig, track: BodyTrack, moment: Moment) -> BodyTrack | None:
    """Searches every arm and leg in the track's latest frame; None where none is better."""
    masks = moment.masks()
    pose = track.fit.pose
    observation = observed_near(track.body, views_of(rig, tuple(masks)), masks, pose)
    moved = move_limbs(track.body, observation, track.fit)
    return replace(track, fit=moved) if moved.error < BETTER * track.fit.error else None


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
    sigma = _GIVEN_SIGMA_M if settings.stature_m is not None else _HULL_SIGMA * stature
    observations = []
    for moment, pose in samples:
        masks = moment.masks()
        observations.append(observed_near(track.body, views_of(rig, tuple(masks)), masks, pose))
    surface, poses = adapt_shape(
        track.body.surface,
        observations,
        [pose for _, pose in samples],
        Stature(stature, sigma),
        model.shape,
    )
    body = BodyGeometry.from_surface(surface, _VOXEL_M)
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
    settings = _FIRST_STEP if track.before is None else STEP
    usual, waiting, searches, wrong = track.usual, list(moments), 0, 0
    while waiting:
        near = [one for one in waiting[:2] if one.time_s - track.time_s < _LONGEST_STEP_S]
        moment = near[-1] if len(near) == 2 and len(waiting) > 2 else waiting[0]
        waiting = [one for one in waiting if one.time_s > moment.time_s]
        track = track.step(rig, moment.time_s, moment.masks(), settings)
        settings = STEP
        if track.fit.error > _SUDDEN * usual + _SUDDEN_BY and searches < _MOST_SEARCHES:
            searches += 1
            track = search_limbs(rig, track, moment) or track
        wrong = wrong + 1 if track.fit.error > max(SUSPECT, _SUDDEN * usual) else 0
        if track.fit.error > LOST or wrong == _MOST_WRONG:
            return None
    return track


def _first_poses(body: BodyGeometry, frame: FrameObservation, count: int) -> list[PoseFit]:
    """As `find_pose`, with fewer contour points and without the search of limbs on silhouettes."""
    middle = frame.grid.occupied_points(frame.occupancy).mean(0)
    observation = observation_at(frame.views, frame.masks, middle)

    def matched(start: Pose) -> PoseFit:
        pose = match(body.body_volume, frame.grid, frame.occupancy, start).pose
        return refine_fit(body, observation, pose, None, _FIRST_STEP)

    starts = find_torso(body.body_volume, frame.grid, frame.occupancy, count)
    fits = sorted(map(matched, starts), key=lambda fit: fit.error)
    # With the torso now well placed the limbs are matched again.
    again = [matched(fit.pose) for fit in fits[:2]]
    return sorted([*again, *fits], key=lambda fit: fit.error)


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
    return BodyGeometry.from_surface(Surface(model), _VOXEL_M)


def _hull(rig: Rig, masks: Masks) -> FrameObservation | None:
    """Silhouettes of one body and its hull; None where they do not meet in space."""
    views, images = views_of(rig, tuple(masks)), list(masks.values())
    rule = body_rule(len(images), 0)
    try:
        grid = place_grid(views.rig, images, voxel_size_m=2 * _VOXEL_M, rule=rule)
    except InputError:
        return None
    return HullObserver(views, grid, _VOXEL_M, rule).observe(images)
