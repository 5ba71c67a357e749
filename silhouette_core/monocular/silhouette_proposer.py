"""Poses of a person by a few silhouettes of one camera, from the proposal that comes with the
program: for whoever has silhouettes, and no track yet.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.monocular.person import find_person, upright_distance
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking.pose_modes import FrameModes, ModeFinder, ModeView
from silhouette_core.monocular.window import STATURE_PX, look_at

_ROUNDS = 3  # in which the distance is corrected


class SilhouetteProposer:
    """See `silhouette_core.refinement.proposed_poses.PoseProposer`. Beyond paper A."""

    def propose(
        self,
        camera: Camera,
        stature_m: float,
        times_s: Sequence[float],
        masks: Sequence[NDArray[np.bool_]],
        wanted: int,
    ) -> FrameModes | None:
        """See `PoseProposer.propose`."""
        found = [find_person(mask) for mask in masks]
        people = {t: person.mask for t, person in enumerate(found) if person is not None}
        if wanted not in people:
            return None
        finder = ModeFinder(shipped_proposal(), camera, stature_m)

        def view(t: int, distance_m: float) -> ModeView:
            window = look_at(camera, people[t], distance_m, STATURE_PX / stature_m)
            return finder.view(window, times_s[t])

        distance_m = upright_distance(camera, people[wanted], stature_m)
        for _ in range(_ROUNDS):
            distance_m = finder.distance([view(wanted, distance_m)])
        return finder.find([view(t, distance_m) for t in people])[[*people].index(wanted)]
