"""The body adapted again, and the template of the other sex."""

from contextlib import closing

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.progress import StageClock
from silhouette_core.refinement.adaptation import Stature
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    joint_errors_m,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.person.body_choice import Start
from voxelpose.multiview.person.posterior import Candidate, ShapePrior, StatureEvidence
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.recording_track import refit
from voxelpose.multiview.tracking.tracking import PoseTracker

VOXEL_M = 0.04
VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)
TURNS = (
    {},
    {"left_thigh.flexion": 40.0, "left_shin.flexion": 50.0},
    {"right_upper_arm.abduction": 45.0},
)


def test_the_body_is_adapted_to_the_poses_that_were_followed():
    """Tracking began with a usual body, whose joints are elsewhere."""
    person, seen_by = other_body(1), views(4)
    usual = BodyModel.from_sizes(BodySizes(STATURE_M, sex=person.sizes.sex))
    first = BodyGeometry.from_model(usual, VOXEL_M, "cpu")
    observer = HullObserver(seen_by, VOLUME, VOXEL_M, CarveRule(least_agreeing=3))
    shape = first.model.shape
    prior = ShapePrior(Stature(STATURE_M, 0.02), shape, np.diag(SHAPE_SIGMA**2))
    candidate = Candidate(STATURE_M, None, first.model.sizes.sex)
    start = Start(candidate, first, prior, StatureEvidence(STATURE_M), {}, {}, {})
    poses = [stance(person, turns) for turns in TURNS]
    with (
        closing(MaskStore([camera.size for camera in seen_by.rig], len(poses))) as masks,
        closing(ObservationStore(observer, masks)) as store,
    ):
        for t, pose in enumerate(poses):
            masks.put(t, photograph(seen_by, person, pose))
        settings = 1.0, MatchSettings()  # a second is between the stances
        tracker = PoseTracker(first, store, *settings, StageClock(), lambda: None)
        tracker.follow((t, PoseFit(pose, 0.1)) for t, pose in enumerate(poses))
        errors_m = []
        for _ in range(2):
            tracker.smooth()
            pairs = zip(tracker.poses, poses, strict=True)
            errors_m.append(
                [
                    joint_errors_m(tracker.body.model, own, person, true)
                    for own, true in pairs
                    if own is not None
                ]
            )
            refit(tracker, start)
    assert np.mean(errors_m[1]) < 0.8 * np.mean(errors_m[0])
