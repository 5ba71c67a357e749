"""Heading, tilt and mirrors."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import EXCHANGED_LANDMARKS
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.heading import fastest_turn, mirrored, split_heading
from silhouette_core.motion.motion import Motion
from tests.clips import waving

MODEL = BodyModel.from_sizes(BodySizes(1.7))


def any_rotations(rng: np.random.Generator, count: int) -> np.ndarray:
    quaternion = rng.normal(size=(count, 4))
    return quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)


def any_motion(seed: int, count: int = 3) -> Motion:
    rng = np.random.default_rng(seed)
    low, high = MODEL.tree.dof_limits_rad.T
    return Motion(
        30.0,
        MODEL,
        rng.normal(size=(count, 3)),
        any_rotations(rng, count),
        rng.uniform(low, high, (count, len(low))),
    )


@given(st.integers(0, 10_000))
def test_heading_and_tilt_make_the_rotation(seed):
    quaternion = any_rotations(np.random.default_rng(seed), 5)
    heading, tilt = split_heading(quaternion)
    again = Rotation.from_euler("z", heading[:, None]) * Rotation.from_quat(tilt, scalar_first=True)
    assert (
        again.inv() * Rotation.from_quat(quaternion, scalar_first=True)
    ).magnitude().max() < 1e-9
    np.testing.assert_allclose(tilt[:, 3], 0)
    np.testing.assert_allclose(np.linalg.norm(tilt, axis=1), 1)
    assert (tilt[:, 0] >= 0).all() and (np.abs(heading) <= np.pi).all()


def test_who_stands_on_the_head_has_no_heading():
    heading, tilt = split_heading(np.array([[0.0, 0.6, 0.8, 0.0]]))
    np.testing.assert_allclose(heading, 0)
    np.testing.assert_allclose(tilt, [[0, 0.6, 0.8, 0]])


@settings(deadline=None)  # the first call compiles
@given(st.integers(0, 10_000))
def test_mirrored_twice_is_the_same(seed):
    motion = any_motion(seed)
    again = mirrored(mirrored(motion))
    np.testing.assert_allclose(again.angles_rad, motion.angles_rad)
    np.testing.assert_allclose(again.root_m, motion.root_m)
    np.testing.assert_allclose(again.root_quaternion, motion.root_quaternion)


@settings(deadline=None)  # the first call compiles
@given(st.integers(0, 10_000))
def test_mirrored_landmarks_are_reflected_and_swapped(seed):
    motion = any_motion(seed)
    expected = motion.landmarks()[:, EXCHANGED_LANDMARKS] * (-1, 1, 1)
    # The template is symmetric to some millimetres.
    np.testing.assert_allclose(mirrored(motion).landmarks(), expected, atol=5e-3)


def test_quality_follows_its_part():
    motion = waving()
    overlap = mirrored(motion).quality["part_overlap"]
    left, right = MODEL.names.index("left_hand"), MODEL.names.index("right_hand")
    np.testing.assert_array_equal(overlap[:, left], motion.quality["part_overlap"][:, right])
    np.testing.assert_array_equal(
        mirrored(motion).quality["unexplained"], motion.quality["unexplained"]
    )


def turning(yaw_deg: list[float], first: int = 7) -> Motion:
    count = len(yaw_deg)
    # The pelvis leans: a turn is one all the same.
    turn = Rotation.from_euler("z", np.array(yaw_deg)[:, None], degrees=True)
    leant = (turn * Rotation.from_euler("x", 40, degrees=True)).as_quat(scalar_first=True)
    rest = np.zeros((count, MODEL.tree.dof_limits_rad.shape[0]))
    return Motion(25.0, MODEL, np.zeros((count, 3)), leant, rest, first + np.arange(count))


def test_the_fastest_turn_is_found_across_the_half_circle():
    speed, frame = fastest_turn(turning([170.0, 178.0, -162.0, -160.0]))
    assert abs(speed - 20 * 25) < 1e-6 and frame == 9
    assert fastest_turn(turning([30.0])) == (0.0, 7)
