"""Poses over time: what was begun wrongly."""

from collections.abc import Iterator
from contextlib import closing, nullcontext

import numpy as np
import pytest

from silhouette_core.motion.kinematics import centres_of
from silhouette_core.motion.pose import JointTarget
from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    joint_errors_m,
    other_body,
    photograph,
    stance,
    turned,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import BodyGeometry, PoseFit
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.tracking.tracking import PoseTracker

pytestmark = pytest.mark.slow
FRAMES = 7
ACTOR = other_body(1)
TRUTH = [
    stance(ACTOR, {"left_upper_arm.abduction": 8.0 * t, "right_thigh.flexion": 5.0 * t})
    for t in range(FRAMES)
]


@pytest.fixture(scope="module")
def observations() -> Iterator[ObservationStore]:
    seen_by = views(4)
    volume = VoxelGrid.from_bounds((-1, -1, -0.1), (1, 1, 2.2), 0.05)
    observer = HullObserver(seen_by, volume, 0.03, CarveRule(least_agreeing=3))
    with (
        closing(MaskStore([camera.size for camera in seen_by.rig], FRAMES)) as masks,
        closing(ObservationStore(observer, masks)) as store,
    ):
        for t, pose in enumerate(TRUTH):
            masks.put(t, photograph(seen_by, ACTOR, pose))
        yield store


@pytest.fixture
def tracker(observations) -> PoseTracker:
    model = fitting_model()
    body = BodyGeometry(model, BodyVolume.from_model(model, 0.03, "cpu"), Surface(model, 600))
    settings = 30.0, MatchSettings()
    return PoseTracker(body, observations, *settings, lambda _: nullcontext(), lambda: None)


def test_a_joint_that_was_set_is_there_in_its_frame(tracker):
    """Frames far from it stay as they are."""
    model, frames = tracker.body.model, np.arange(10, 10 + FRAMES)
    elbow = model.tree.landmark_names.index("left_elbow")
    places = centres_of(ACTOR, TRUTH)[:, elbow]
    places[3] += (0.0, -0.06, 0.02)
    target = JointTarget("left_elbow", 13, tuple(places[3]))
    settings = 30.0, MatchSettings(), lambda _: nullcontext(), lambda: None, frames, [target]
    track = PoseTracker(tracker.body, tracker.observations, *settings)
    track.follow([(2, PoseFit(TRUTH[2], 0.1))])
    track.reach_targets()
    track.smooth()
    found = centres_of(model, [pose for pose in track.poses if pose is not None])[:, elbow]
    far_m = np.linalg.norm(found - places, axis=1)
    assert far_m[3] < 0.015 and far_m[[0, 6]].max() < 0.04


def errors_m(tracker: PoseTracker) -> np.ndarray:
    return np.array(
        [
            joint_errors_m(tracker.body.model, pose, ACTOR, true).mean()
            for pose, true in zip(tracker.poses, TRUTH, strict=True)
        ]
    )


@pytest.mark.parametrize("wrong", [[4, 5, 6], [0, 1]])
def test_what_begins_turned_half_round_is_decided_by_the_whole_trajectory(tracker, wrong):
    fits = [(t, PoseFit(turned(TRUTH[t], 180), 0.2)) for t in wrong]
    right = next(t for t in (2, 3) if t not in wrong)
    tracker.follow([*fits, (right, PoseFit(TRUTH[right], 0.1))])
    assert errors_m(tracker).max() < 0.05


def test_first_poses_that_are_all_wrong_are_searched_again(tracker):
    tracker.follow((t, PoseFit(turned(pose, 180), 0.3)) for t, pose in enumerate(TRUTH))
    tracker.search_worst(3)
    assert errors_m(tracker).max() < 0.06
