"""The body that a fit begins with, where nothing is told of the person."""

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from silhouette_core.scoring.cpu import CPU
from tests.voxelpose.matching.matching_scenes import (
    STATURE_M,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.carving.carver import CarveRule
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.body_choice import _stature_from_hull
from voxelpose.matching.matcher import MatchSettings
from voxelpose.matching.observe import HullObserver

VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)
CROUCH = {
    f"{side}_{name}": degrees
    for side in ("left", "right")
    for name, degrees in (("thigh.flexion", 80.0), ("shin.flexion", 95.0))
}


@pytest.mark.slow
def test_somebody_who_crouches_most_of_the_time_is_no_child():
    body, observer = other_body(), HullObserver(views(4), VOLUME, 0.04, CarveRule(least_agreeing=3))
    poses = [stance(body, CROUCH | {"lumbar.flexion": lean}) for lean in (20.0, 30.0, 40.0)]
    poses.append(stance(body))
    frames = {
        t: observer.observe(photograph(observer.views, body, pose)) for t, pose in enumerate(poses)
    }
    heights = [np.ptp(np.flatnonzero(frame.occupancy.any((0, 1)))) for frame in frames.values()]
    assert np.median(heights) < 0.85 * max(heights)
    stature = _stature_from_hull(frames, Settings(), MatchSettings(), 0.04, CPU)
    assert stature.metres == pytest.approx(STATURE_M, rel=0.06)


@pytest.mark.slow
def test_somebody_who_sits_all_the_time_is_no_child():
    body, observer = other_body(), HullObserver(views(4), VOLUME, 0.04, CarveRule(least_agreeing=3))
    seated = {
        f"{side}_{name}": 90.0
        for side in ("left", "right")
        for name in ("thigh.flexion", "shin.flexion")
    }
    frames = {
        t: observer.observe(
            photograph(observer.views, body, stance(body, seated | {"lumbar.flexion": 10.0 * t}))
        )
        for t in range(3)
    }
    stature = _stature_from_hull(frames, Settings(), MatchSettings(), 0.04, CPU)
    assert stature.metres == pytest.approx(STATURE_M, rel=0.07)
