import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.refinement.observation import PinholeViews
from tests.voxelpose.multiview.carving.carving_scenes import ring
from voxelpose.multiview.person.proposals import triangulated, triangulated_proposals

RIG = ring(4)
VIEWS = PinholeViews.from_rig(RIG)
JOINTS = BodyModel.from_sizes(BodySizes(1.85)).landmarks_m


def seen_by(cameras, joints_m=JOINTS, noise=0.0, visibility=1.0):
    rng, seen = np.random.default_rng(0), {}
    for c in cameras:
        inside = joints_m @ RIG.cameras[c].rotation.T + RIG.cameras[c].translation
        rays = inside / inside[:, 2:]
        rays[:, :2] += rng.normal(0, noise, (15, 2)) / inside[:, 2:]
        seen[c] = SeenJoints(rays, np.full(15, visibility))
    return seen


@pytest.mark.parametrize("cameras", [(0, 1), (0, 2, 3), (0, 1, 2, 3)])
def test_joints_lie_where_their_rays_meet(cameras):
    prior = triangulated(seen_by(cameras), VIEWS)
    np.testing.assert_allclose(prior.landmarks_m, JOINTS, atol=1e-9)
    assert (np.linalg.eigvalsh(prior.precision) > 0).all()


def test_one_camera_says_nothing():
    assert triangulated(seen_by([2]), VIEWS) is None
    assert triangulated({}, VIEWS) is None


def test_a_camera_that_sees_a_wrist_elsewhere_is_outvoted():
    wrist = LANDMARK_NAMES.index("left_wrist")
    seen = seen_by(range(4), noise=0.01)
    seen[1].rays[wrist, 0] += 0.3
    error = np.linalg.norm(triangulated(seen, VIEWS).landmarks_m - JOINTS, axis=1)
    assert error[wrist] < 0.05 and error.max() < 0.05


def test_what_is_hidden_from_a_camera_counts_for_less():
    seen = seen_by(range(3))
    hidden = SeenJoints(seen[0].rays, np.zeros(15))
    sure = triangulated(seen, VIEWS).precision
    less = triangulated(seen | {0: hidden}, VIEWS).precision
    assert (np.linalg.det(less) <= np.linalg.det(sure)).all() and (less != sure).any()


class Observations:
    """Frames in which the cameras see somebody, the last of which only one does."""

    class observer:
        views = VIEWS

    def joints(self, t):
        return seen_by(range(4) if t < 2 else [0])


def test_frames_tell_the_stature_by_the_bones():
    proposals = triangulated_proposals(Observations(), [0, 1, 2], None)
    assert set(proposals) == {0, 1}
    assert proposals[0].stature_m == pytest.approx(1.85, abs=0.02)
    assert triangulated_proposals(Observations(), [0], 1.6)[0].stature_m == 1.6
    right, wrong = JOINTS, JOINTS * (-1, -1, 1)
    costs = proposals[0].cost(np.stack([right, wrong]))
    assert costs[1] - costs[0] > 3
