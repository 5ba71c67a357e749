"""ForwardFilter kinematics against rotations multiplied by scipy, and its derivatives against
differences.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN, LANDMARK_NAMES, PARENTS, PART_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.kernels.kinematics import exponential_map
from silhouette_core.motion.kinematics import (
    forward,
    landmarks,
    place_with_axes,
    quaternions,
    rotation_matrices,
    skin,
)


@pytest.fixture(scope="module")
def model():
    return BodyModel.from_sizes(BodySizes(1.75, sex="female"))


@pytest.fixture
def clip(model):
    rng = np.random.default_rng(0)
    low, high = model.tree.dof_limits_rad.T
    return (
        rng.normal(size=(4, 3)),
        Rotation.random(4, random_state=1).as_quat(scalar_first=True),
        rng.uniform(low, high, (4, len(low))),
    )


def test_at_rest_nothing_moves(model):
    rotation, origin = forward(
        model, model.joints_m[:1], np.array([[1.0, 0, 0, 0]]), np.zeros((1, model.dof_count))
    )
    np.testing.assert_allclose(rotation[0], np.tile(np.eye(3), (27, 1, 1)), atol=1e-15)
    np.testing.assert_allclose(origin[0], model.joints_m, atol=1e-12)
    np.testing.assert_allclose(skin(model, rotation[0], origin[0]), model.vertices_m, atol=1e-7)
    np.testing.assert_allclose(landmarks(model, rotation, origin)[0], model.landmarks_m, atol=1e-12)


def test_axes_are_the_derivatives_of_the_joints(model, clip):
    root, quaternion, angles = (array[0] for array in clip)

    def placed(q):
        matrix = rotation_matrices(quaternion)
        return [one[0] for one in place_with_axes(model, root[None], matrix[None], q[None])]

    _, origin, axis = placed(angles)
    step = 1e-6
    for k, (part, _) in enumerate(HUMAN.dofs):
        ahead, behind = (
            placed(angles + sign * step * np.eye(model.dof_count)[k]) for sign in (1, -1)
        )
        moved = (ahead[1] - behind[1]) / (2 * step)
        turned = (ahead[0] - behind[0]) / (2 * step)
        below = np.array([part in _ancestors(p) for p in range(27)])
        np.testing.assert_allclose(
            moved[below], np.cross(axis[k], origin[below] - origin[part]), atol=1e-8
        )
        np.testing.assert_allclose(moved[~below], 0, atol=1e-9)
        np.testing.assert_allclose(
            turned[part], np.cross(axis[k], placed(angles)[0][part], axisb=0, axisc=0), atol=1e-8
        )


def _ancestors(part):
    result = []
    while part >= 0:
        result.append(part)
        part = PARENTS[part]
    return result


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-5, 9e-5, 1.1e-4, 0.5, 3.1, 7.0])
def test_turning_by_small_and_large_vectors(length):
    vector = length * np.array([0.6, -0.64, 0.48])
    rotation, jacobian = np.empty((3, 3)), np.empty((3, 3))
    exponential_map(vector, rotation, jacobian)
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(vector).as_matrix(), atol=1e-13)
    # Exp(v + dv) = Exp(J dv) Exp(v)
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        ahead, behind = (Rotation.from_rotvec(vector + sign * step) for sign in (1, -1))
        np.testing.assert_allclose(
            jacobian[:, k], (ahead * behind.inv()).as_rotvec() / 2e-6, atol=1e-8
        )


def test_landmarks_are_the_joints_of_their_names(model, clip):
    rotation, origin = forward(model, *clip)
    result = landmarks(model, rotation, origin)
    for name, part in (
        ("left_knee", "left_shin"),
        ("right_wrist", "right_hand"),
        ("pelvis", "pelvis"),
        ("right_hip", "right_thigh"),
    ):
        np.testing.assert_allclose(
            result[:, LANDMARK_NAMES.index(name)], origin[:, PART_NAMES.index(part)], atol=1e-12
        )


def test_positive_angles_make_the_named_movement(model):
    """Flexing lifts the thigh forward (-y), abduction leads away from the middle, the knee bends
    backward, on both sides.
    """

    def moved(turns):
        angles = np.zeros((1, model.dof_count))
        for name, degrees in turns.items():
            angles[0, model.tree.dof_names.index(name)] = np.radians(degrees)
        placed = landmarks(
            model, *forward(model, model.joints_m[:1], np.array([[1.0, 0, 0, 0]]), angles)
        )[0]
        return {name: placed[k] - model.landmarks_m[k] for k, name in enumerate(LANDMARK_NAMES)}

    for side, out in (("left", 1), ("right", -1)):
        assert moved({f"{side}_thigh.flexion": 40})[f"{side}_knee"][1] < -0.2
        assert moved({f"{side}_thigh.abduction": 30})[f"{side}_knee"][0] * out > 0.1
        assert moved({f"{side}_shin.flexion": 60})[f"{side}_ankle"][1] > 0.2
        assert moved({f"{side}_upper_arm.abduction": 45})[f"{side}_elbow"][2] > 0.1
        assert moved({f"{side}_upper_arm.forward": 60})[f"{side}_elbow"][1] < -0.1
        assert moved({f"{side}_clavicle.elevation": 20})[f"{side}_shoulder"][2] > 0.03
    assert moved({"lumbar.flexion": 40})["head_top"][1] < -0.2


def test_quaternions_and_back():
    given = Rotation.random(20, random_state=3).as_matrix().reshape(4, 5, 3, 3)
    result = quaternions(given)
    assert (result[..., 0] >= 0).all()
    np.testing.assert_allclose(rotation_matrices(result), given, atol=1e-12)
