"""The body adapted again, and the template of the other sex."""

from contextlib import closing

import numpy as np
import pytest

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
from voxelpose.multiview.matching.pose_search import BodyGeometry
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


def body_of(sex):
    return BodyModel.from_sizes(BodySizes(STATURE_M, sex=sex))


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_other_template_is_taken_where_it_is_more_probable(sex):
    """Tracking began with the other sex's body, whose hips are elsewhere."""
    person, seen_by = other_body(1, sex), views(4)
    first = BodyGeometry.from_model(
        body_of({"male": "female", "female": "male"}[sex]), VOXEL_M, "cpu"
    )
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
        settings = 30.0, MatchSettings()
        found = {}
        for any_sex in (False, True):
            tracker = PoseTracker(first, store, *settings, StageClock(), lambda: None)
            tracker.begin(dict(enumerate(poses)), dict.fromkeys(range(len(poses)), 0.1))
            tracker.polish()
            refit(tracker, start, any_sex)
            tracker.polish()
            found[any_sex] = tracker
    assert found[False].body.model.sizes.sex == first.model.sizes.sex
    assert found[True].body.model.sizes.sex == sex
    wrong, right = (
        np.mean(
            [
                joint_errors_m(tracker.body.model, own, person, true)
                for own, true in zip(tracker.poses, poses, strict=True)
            ]
        )
        for tracker in found.values()
    )
    assert right < 0.8 * wrong
