"""Poses of a person by silhouettes of one camera, from the proposal that comes with the program:
for whoever has silhouettes, and no track yet.
"""

from collections.abc import Iterable

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray
from silhouette_core.monocular.person import find_person
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking.pose_modes import MEMORY_S, FrameModes, ModeFinder, ModeView


class SilhouetteProposer:
    """See `silhouette_core.refinement.proposed_poses.PoseProposer`. Beyond paper A."""

    def propose(
        self, camera: Camera, stature_m: float, frames: Iterable[tuple[float, BoolArray]]
    ) -> list[FrameModes | None]:
        """See `PoseProposer.propose`."""
        finder = ModeFinder(shipped_proposal(), camera, stature_m)
        views: dict[int, ModeView] = {}
        distance_m, count = np.nan, 0
        for t, (time_s, mask) in enumerate(frames):
            count, person = t + 1, find_person(mask)
            if person is None:
                continue
            recent = [one for one in views.values() if time_s - one.time_s <= MEMORY_S]
            if not recent:
                distance_m = finder.first_distance(person.mask, time_s)
            views[t] = finder.view(finder.window(person.mask, distance_m), time_s)
            distance_m = finder.distance([*recent, views[t]])
        modes = dict(zip(views, finder.find([*views.values()]), strict=True)) if views else {}
        return [modes.get(t) for t in range(count)]
