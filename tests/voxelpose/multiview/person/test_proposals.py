"""What each camera proposes where cameras look the same way."""

from contextlib import closing

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.estimator import Settings
from silhouette_core.motion.kinematics import joints_of
from silhouette_core.progress import SilentReporter
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.refinement.proposed_poses import ProposedPoses
from silhouette_core.tuning import MEASURING
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    fitting_model,
    photograph,
    stance,
    turned,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.person import proposals
from voxelpose.multiview.person.body_choice import choose_body
from voxelpose.multiview.person.proposals import FrameProposals
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore

BODY = fitting_model()
CENTERS = np.array([[-0.8, -3.9, 1.3], [0.8, -3.9, 1.3]])  # 23 degrees apart
VOLUME = VoxelGrid.from_bounds((-1.2, -1.6, -0.1), (1.2, 2.6, 2.3), 0.05)


def proposed(joints_m: np.ndarray) -> ProposedPoses:
    precision = np.tile(np.eye(3) / 0.05**2, (15, 1, 1))
    prior = LandmarkPrior(joints_m - joints_m[0], precision, joints_m[0], precision[0])
    return ProposedPoses(np.ones(1), [prior])


def test_what_each_camera_sees_nearer_is_smaller():
    """A person of 0.8 times the usual stature, whom each camera takes for an adult farther away."""
    truth = 0.8 * joints_of(BODY, [stance(BODY)])[0] * MEASURING.usual_m / STATURE_M
    alone = [proposed(center + (truth - center) / 0.8) for center in CENTERS]
    found = FrameProposals.of(alone, CENTERS)
    assert found.stature_m == pytest.approx(0.8 * MEASURING.usual_m, rel=0.01)
    for one in found.poses:
        np.testing.assert_allclose(one.likeliest, truth, atol=0.02)
    assert found.cost(truth[None])[0] < found.cost(truth[None, ::-1])[0] - 1


def test_a_known_stature_stays_whatever_the_rays_say():
    truth = joints_of(BODY, [stance(BODY)])[0]
    alone = [proposed(center + (truth - center) / 0.8) for center in CENTERS]
    known = FrameProposals.of(alone, CENTERS, 1.9)
    assert known.stature_m == 1.9
    np.testing.assert_allclose(known.poses[0].likeliest[0], truth[0], atol=0.02)
    same = np.tile(CENTERS[:1], (2, 1))  # cameras in one place tell no distance
    unknown = FrameProposals.of([alone[0], alone[0]], same)
    assert unknown.stature_m == pytest.approx(MEASURING.usual_m)


@pytest.mark.parametrize("facing", [0.0, 180.0])
def test_proposals_decide_which_way_round_somebody_stands(monkeypatch, facing):
    """Two cameras side by side see the same outlines of somebody's front and back."""
    expected = joints_of(BODY, [turned(stance(BODY), facing)])[0]

    class Proposer:
        def propose(self, camera, stature_m, frames):
            scaled = camera.center_m + (expected - camera.center_m) * stature_m / STATURE_M
            return [proposed(scaled) for _ in frames]

    monkeypatch.setattr(proposals, "load_pose_proposer", Proposer)
    cameras = [
        look_at(f"cam_{k}", at, (0, 0, 0.9), (320, 320), 290) for k, at in enumerate(CENTERS)
    ]
    seen_by = PinholeViews.from_rig(Rig(tuple(cameras)))
    observer = HullObserver(seen_by, VOLUME, 0.04, CarveRule(least_agreeing=2))
    with (
        closing(MaskStore([camera.size for camera in cameras], 2)) as masks,
        closing(ObservationStore(observer, masks)) as store,
    ):
        for t in range(2):
            masks.put(t, photograph(seen_by, BODY, stance(BODY)))
        start = choose_body(store, Settings(), MatchSettings(), SilentReporter(), 30.0)
    assert start.evidence.is_far_open and start.proposals
    assert start.prior.stature.metres == pytest.approx(STATURE_M, rel=0.03)
    found = joints_of(start.body.model, [*start.poses.values()])
    apart = np.linalg.norm((found - found[:, :1]) - (expected - expected[0]), axis=2).mean()
    assert apart < 0.06
