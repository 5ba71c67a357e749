"""Candidates for the person that is seen, and what is known of the person before any is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import CHESTS_M, STATURES_M, BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.tuning import MEASURING
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.tuning import HULL_GIRTH, PERSON_COST

GIRTH_CAMERAS = 4
"""Fewest cameras whose hull says anything of the girth: that of fewer varies too much."""


def hull_volume_m3(frame: FrameObservation) -> float:
    """Volume of a frame's visual hull."""
    return float(np.count_nonzero(frame.occupancy) * frame.grid.voxel_size_m**3)


def chest_from_hull(model: BodyModel, hull_m3: float) -> float:
    """Chest girth, m, with which a usual body fills a hull, m³, as far as people's go."""
    usual_m3 = HULL_GIRTH.hull_over_body * model.part_volumes_m3(0.02).sum()
    girth = float(np.clip(np.sqrt(hull_m3 / usual_m3), HULL_GIRTH.least, HULL_GIRTH.most))
    return float(np.clip(girth * HULL_GIRTH.usual_chest * model.sizes.stature_m, *CHESTS_M))


POSTURES = "any", "sitting"
"""What a candidate does: anything, or sitting as on a chair in all frames."""


@dataclass(frozen=True)
class Candidate:
    """Who may be seen, and how.

    Attributes:
        stature: height, m.
        girth: chest girth, m; None: usual for the stature.
        template: "male" or "female".
        posture: of `POSTURES`.
        objects: whether something that stays beside the person is left out of the silhouettes.
    """

    stature: float
    girth: float | None
    template: str
    posture: str = "any"
    objects: bool = False

    @property
    def sizes(self) -> BodySizes:
        """Measurements of the body, as far as people's go."""
        girth = None if self.girth is None else float(np.clip(self.girth, *CHESTS_M))
        return BodySizes(float(np.clip(self.stature, *STATURES_M)), girth, self.template)


@dataclass(frozen=True)
class StatureEvidence:
    """Stature told by the user, m, if any, and the usual and largest height of the hull."""

    told_m: float | None
    hull_m: tuple[float, ...] = ()

    @classmethod
    def from_frames(
        cls, frames: Mapping[int, FrameObservation], settings: Settings
    ) -> StatureEvidence:
        """StatureEvidence of some frames by number."""
        heights_m = [hull_height_m(frame) for frame in frames.values()]
        return cls(settings.stature_m, (float(np.median(heights_m)), max(heights_m)))

    def statures_m(self, posture: str) -> tuple[tuple[float, ...], ...]:
        """Statures from which searches in a posture begin, likeliest first; a tuple a search."""
        if self.told_m is not None:
            return ((self.told_m,),)
        usual, largest = self.hull_m
        # Somebody who crouches or jumps is as high as the hull is at times.
        varies = np.log(largest / usual) > 2 * PERSON_COST.hull_sigma
        heights = ((usual, largest) if varies else (usual,),) if posture == "any" else ()
        return (*heights, (MEASURING.usual_m,))


def hull_height_m(frame: FrameObservation) -> float:
    """Height of a frame's visual hull, m."""
    levels = np.flatnonzero(frame.occupancy.any((0, 1)))
    return float(np.ptp(levels) + 1) * frame.grid.voxel_size_m
