"""A person's stature by the visual hull, where nobody told it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.scoring.backend import Backend
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import SEARCHED, BodyGeometry, find_pose, refine_fits
from voxelpose.multiview.person.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3

HULL_SIGMA = 0.05
"""Standard deviation of a stature that was estimated from the hull, as a fraction of it."""
_VARIES = 1.1  # the hull's largest height over its usual one from which both are looked at
# Tried on a stature estimated from the hull: arms overhead or a crouch falsify it.
_SCALES = (0.93, 1.0, 1.07)
# Of adults. Who hangs, sits or lies all the time is taken for one who does not, if by little.
ADULT_M = 1.70
"""Stature of an adult."""
_ADULT_SIGMA_M, _UNUSUAL = 0.12, 0.01
_FAR = 1.15  # factor from which two statures are not alike


def stature_candidates(
    frames: dict[int, FrameObservation],
    settings: Settings,
    matching: MatchSettings,
    voxel_size_m: float,
    backend: Backend,
) -> list[Stature]:
    """Statures by the hull: that of the body which fits best, and where that is not of the hull's
    height, the best of those that are.

    Compared are bodies about the hull's usual height, in a frame of that height; where it varies,
    as in somebody who crouches or jumps, about its largest, in the tallest frame as well; and where
    all of these are unusual statures, about an adult's. Each has the usual girth, and the hull's.

    Args:
        frames: some frames.
        settings: for the chest girth, where it is known.
        matching: settings of the pose search.
        voxel_size_m: size of the voxels that are matched.
        backend: of the scoring.
    """
    heights_m = {t: _height_m(frame) for t, frame in frames.items()}
    middle, tallest = float(np.median(list(heights_m.values()))), max(heights_m.values())
    shown = [middle, tallest] if tallest > _VARIES * middle else [middle]
    looked_at = [
        frames[min(heights_m, key=lambda t, height=height: abs(heights_m[t] - height))]
        for height in shown
    ]
    bodies = _Bodies(settings.chest_m, voxel_size_m, backend)
    unusual = not any(_alike(height, ADULT_M) for height in shown)
    searched = [bodies.of(height) for height in [*shown, *([ADULT_M] if unusual else [])]]
    starts = [_starts(frame, searched, matching) for frame in looked_at]
    compared = [bodies.scaled(body, scale) for body in searched for scale in _SCALES]
    if settings.chest_m is None and len(looked_at[0].masks) >= GIRTH_CAMERAS:
        # A tall body bent over fills the hull of a short and stout one, too.
        volume_m3 = float(np.median([hull_volume_m3(frame) for frame in frames.values()]))
        compared += [bodies.filling(volume_m3, body) for body in compared]

    def error(body: BodyGeometry) -> float:
        return (1 + _UNUSUAL * unusual_by(body.model.sizes.stature_m) ** 2) * sum(
            min((fit.error for fit in refine_fits(body, frame.observation, begun)), default=np.inf)
            for frame, begun in zip(looked_at, starts, strict=True)
        )

    order = np.argsort(side_by_side(error, compared), kind="stable")
    ranked = [compared[k].model.sizes.stature_m for k in order]
    high = [metres for metres in ranked if any(_alike(metres, k) for k in (middle, tallest))]
    chosen = ranked[:1] if ranked[0] in high else [ranked[0], *high[:1]]
    return [Stature(metres, HULL_SIGMA * metres) for metres in chosen]


def unusual_by(metres: float) -> float:
    """By how many standard deviations a stature differs from an adult's."""
    return abs(metres - ADULT_M) / _ADULT_SIGMA_M


@dataclass(frozen=True)
class _Bodies:
    """Bodies of several statures, with the chest girth that is known, if it is."""

    chest_m: float | None
    voxel_size_m: float
    backend: Backend

    def of(self, metres: float, chest_m: float | None = None) -> BodyGeometry:
        sizes = BodySizes(float(np.clip(metres, 0.6, 2.4)), chest_m or self.chest_m, "male")
        return BodyGeometry.from_sizes(sizes, self.voxel_size_m, self.backend)

    def scaled(self, body: BodyGeometry, scale: float) -> BodyGeometry:
        """A body taller by a factor."""
        return body if scale == 1 else self.of(body.model.sizes.stature_m * scale)

    def filling(self, volume_m3: float, body: BodyGeometry) -> BodyGeometry:
        """A body of usual girth with that of a hull of a volume."""
        return self.of(body.model.sizes.stature_m, chest_from_hull(body.model, volume_m3))


def _height_m(frame: FrameObservation) -> float:
    levels = np.flatnonzero(frame.occupancy.any((0, 1)))
    return float(np.ptp(levels) + 1) * frame.grid.voxel_size_m


def _alike(first_m: float, second_m: float) -> bool:
    return abs(np.log(first_m / second_m)) < np.log(_FAR)


def _starts(
    frame: FrameObservation, bodies: Sequence[BodyGeometry], matching: MatchSettings
) -> list[RefineStart]:
    """Postures that are searched with a few bodies, from which the others start."""
    found = side_by_side(lambda body: find_pose(body, frame, matching, count=5)[:3], bodies)
    return [RefineStart(fit.pose, SEARCHED) for fits in found for fit in fits]
