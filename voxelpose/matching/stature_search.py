"""A person's stature by the visual hull, where nobody told it."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.read_ahead import side_by_side
from silhouette_core.refinement.adaptation import Stature
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.scoring.backend import Backend
from voxelpose.matching.girth import GIRTH_CAMERAS, chest_from_hull, hull_volume_m3
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import FrameObservation
from voxelpose.matching.pose_search import SEARCHED, BodyGeometry, find_pose, refine_fits

HULL_SIGMA = 0.05
"""Standard deviation of a stature that was estimated from the hull, as a fraction of it."""
_VARIES = 1.1  # the hull's largest height over its usual one from which both are looked at
# Tried on a stature estimated from the hull: arms overhead or a crouch falsify it.
_SCALES = (0.93, 1.0, 1.07)
# Of adults. Who hangs, sits or lies all the time is taken for one who does not, if by little.
_ADULT_M, _ADULT_SIGMA_M, _UNUSUAL = 1.70, 0.12, 0.01
_FAR = 1.15  # factor from that stature from which an adult is looked at, too


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
    heights = {
        t: float(np.ptp(np.flatnonzero(frame.occupancy.any((0, 1)))) + 1) * frame.grid.voxel_size_m
        for t, frame in frames.items()
    }
    middle, tallest = float(np.median(list(heights.values()))), max(heights.values())
    varies = tallest > _VARIES * middle
    looked_at = [
        frames[min(heights, key=lambda t, height=height: abs(heights[t] - height))]
        for height in ([middle, tallest] if varies else [middle])
    ]

    def of(metres: float, chest_m: float | None = settings.chest_m) -> BodyGeometry:
        sizes = BodySizes(float(np.clip(metres, 0.6, 2.4)), chest_m, "male")
        return BodyGeometry.from_sizes(sizes, voxel_size_m, backend)

    def of_hull(body: BodyGeometry) -> BodyGeometry:
        """That body with the hull's girth."""
        metres = body.model.sizes.stature_m
        usual = body.model if settings.chest_m is None else of(metres, None).model
        return of(metres, chest_from_hull(usual, volume_m3))

    # The postures are searched with few bodies; the others start from them.
    usual = [middle, tallest] if varies else [middle]
    if all(abs(np.log(height / _ADULT_M)) > np.log(_FAR) for height in usual):
        usual.append(_ADULT_M)
    searched = [of(height) for height in usual]
    pairs = [(body, frame) for frame in looked_at for body in searched]
    found = side_by_side(lambda pair: find_pose(*pair, matching, count=5)[:3], pairs)
    starts = [
        [
            RefineStart(fit.pose, SEARCHED)
            for (_, frame), fits in zip(pairs, found, strict=True)
            if frame is looked
            for fit in fits
        ]
        for looked in looked_at
    ]
    bodies = [
        of(body.model.sizes.stature_m * scale) if scale != 1 else body
        for body in searched
        for scale in _SCALES
    ]
    if settings.chest_m is None and len(next(iter(frames.values())).masks) >= GIRTH_CAMERAS:
        # A tall body bent over fills the hull of a short and stout one, too.
        volume_m3 = float(np.median([hull_volume_m3(frame) for frame in frames.values()]))
        bodies += [of_hull(body) for body in bodies]

    def error(body: BodyGeometry) -> float:
        unusual = (body.model.sizes.stature_m - _ADULT_M) / _ADULT_SIGMA_M
        return (1 + _UNUSUAL * unusual**2) * sum(
            min((fit.error for fit in refine_fits(body, frame.observation, begun)), default=np.inf)
            for frame, begun in zip(looked_at, starts, strict=True)
        )

    def is_high(body: BodyGeometry) -> bool:
        """Whether a body is about as tall as the hull."""
        metres = body.model.sizes.stature_m
        return any(abs(np.log(metres / height)) < np.log(_FAR) for height in (middle, tallest))

    ranked = [bodies[k] for k in np.argsort(side_by_side(error, bodies), kind="stable")]
    chosen = ranked[:1] + ([] if is_high(ranked[0]) else list(filter(is_high, ranked))[:1])
    found = [body.model.sizes.stature_m for body in chosen]
    return [Stature(metres, HULL_SIGMA * metres) for metres in found]
