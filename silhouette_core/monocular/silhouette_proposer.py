"""Poses of a person by silhouettes of one camera, from the proposal that comes with the program:
for whoever has silhouettes, and no track yet.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.monocular.person import find_person, upright_distance
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking.pose_modes import FrameModes, ModeFinder, ModeView
from silhouette_core.monocular.window import STATURE_PX, look_at

_ROUNDS = 3  # in which the distance of a first frame is corrected
_RECENT = 12  # frames by which the distance of the next is known


class SilhouetteProposer:
    """See `silhouette_core.refinement.proposed_poses.PoseProposer`. Beyond paper A."""

    def propose(
        self,
        camera: Camera,
        stature_m: float,
        frames: Iterable[tuple[float, NDArray[np.bool_]]],
    ) -> list[FrameModes | None]:
        """See `PoseProposer.propose`."""
        finder = ModeFinder(shipped_proposal(), camera, stature_m)
        views: dict[int, ModeView] = {}
        distance_m, count = np.nan, 0
        for t, (time_s, mask) in enumerate(frames):
            count, person = t + 1, find_person(mask)
            if person is None:
                continue
            first = not views
            if first:
                distance_m = upright_distance(camera, person.mask, stature_m)
            for _ in range(_ROUNDS if first else 1):
                window = look_at(camera, person.mask, distance_m, STATURE_PX / stature_m)
                views[t] = finder.view(window, time_s)
                distance_m = finder.distance([*views.values()][-_RECENT:])
        found = dict(zip(views, finder.find([*views.values()]), strict=True)) if views else {}
        return [found.get(t) for t in range(count)]
