import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.pose_network import POINTS
from silhouette_core.image.seen_joints import SeenJoints, evidence, joint_deviations, joint_weights
from tests.voxelpose.multiview.carving.carving_scenes import look_at

RNG = np.random.default_rng(3)
CAMERA = look_at("cam_1", (3.0, -2.0, 1.4), (0.0, 0.0, 1.0))


def seen_from(camera, joints_m, size=1.0):
    """Joints (15, 3) in the world as a perfect network sees them; it may think them larger."""
    inside = joints_m @ camera.rotation.T + camera.translation
    return SeenJoints(inside / inside[:, 2:], size * (inside - inside[0]), np.ones(15)), inside[
        0, 2
    ]


def test_weights_are_affine_and_lead_to_the_joints_own_points():
    weights = joint_weights()
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=0.02)
    for name, point in (("left_knee", 25), ("right_wrist", 16), ("left_shoulder", 11)):
        assert weights[LANDMARK_NAMES.index(name)].argmax() == point
    across, along = joint_deviations(np.ones(15))
    assert (across[1:] < along[1:] + 0.02).all() and across.max() < 0.1 and along.max() < 0.3
    hidden = joint_deviations(np.zeros(15))
    assert (hidden[0] >= across).all() and (hidden[1] >= along).all()
    assert weights.shape == (15, POINTS)


@pytest.mark.parametrize("size", [0.8, 1.0, 1.3])
def test_joints_are_placed_as_large_as_the_picture_shows_them(size):
    camera, joints = CAMERA, RNG.normal((0, 0, 1), 0.4, (15, 3))
    seen, depth = seen_from(camera, joints, size)
    placed = seen.placed(depth) @ camera.rotation
    np.testing.assert_allclose(placed, joints - joints[0], atol=1e-9)


def test_precision_is_lowest_along_the_ray():
    camera, joints = CAMERA, RNG.normal((0, 0, 1), 0.4, (15, 3))
    seen, _ = seen_from(camera, joints)
    precision = seen.precision()
    unit = seen.rays / np.linalg.norm(seen.rays, axis=1, keepdims=True)
    along = np.einsum("li,lij,lj->l", unit, precision, unit)
    np.testing.assert_allclose(along**-0.5, joint_deviations(seen.visibility)[1])
    np.testing.assert_allclose(precision, precision.transpose(0, 2, 1))


def test_a_mode_turned_half_round_has_far_less_evidence():
    camera = CAMERA
    joints = np.concatenate([[[0, 0, 1.0]], RNG.normal((0, 0, 1), 0.3, (14, 3))])
    seen, depth = seen_from(camera, joints)
    right = joints - joints[0]
    turned = right * (-1, -1, 1)
    precision = np.tile(np.eye(3) / 0.08**2, (2, 15, 1, 1))
    told, means, together = evidence(seen, camera, depth, np.stack([turned, right]), precision)
    assert told[1] - told[0] > 5
    np.testing.assert_allclose(means[1], right, atol=0.01)
    moved = np.linalg.norm(means[0] - turned, axis=1)[1:]
    assert (moved > 0).all()  # toward what is seen
    assert (np.linalg.eigvalsh(together[:, 1:] - precision[:, 1:]) > 0).all()


def test_evidence_does_not_depend_on_the_worlds_axes():
    camera = CAMERA
    joints = RNG.normal((0, 0, 1), 0.3, (15, 3))
    seen, depth = seen_from(camera, joints)
    modes = np.stack([joints - joints[0], RNG.normal(0, 0.3, (15, 3))])
    precision = np.tile(np.diag([90.0, 150.0, 40.0]), (2, 15, 1, 1))
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    other = camera.__class__(**{**vars(camera), "rotation": camera.rotation @ turn.T})
    one = evidence(seen, camera, depth, modes, precision)
    two = evidence(seen, other, depth, modes @ turn.T, turn @ precision @ turn.T)
    np.testing.assert_allclose(one[0], two[0])
    np.testing.assert_allclose(one[1] @ turn.T, two[1], atol=1e-9)
