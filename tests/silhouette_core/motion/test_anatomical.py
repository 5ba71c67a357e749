"""Anatomical angles against bodies bent by hand, and against the rotations they come from."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.motion.anatomical import anatomical_angles, joint_rotations, segment_axes
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.motion import Motion
from tests.clips import waving

BODY = BodyModel.from_sizes(BodySizes(1.7))


def posed(degrees: dict[str, float], heading_deg: float = 0.0) -> Motion:
    angles = np.zeros((1, BODY.dof_count))
    for name, value in degrees.items():
        angles[0, BODY.tree.dof_names.index(name)] = np.radians(value)
    half = np.radians(heading_deg) / 2
    return Motion(
        30.0, BODY, BODY.joints_m[:1].copy(), np.array([[np.cos(half), 0, 0, np.sin(half)]]), angles
    )


def angle(degrees: dict[str, float], name: str) -> float:
    return float(anatomical_angles(posed(degrees))[name][0])


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("turn", "by", "name", "change"),
    [
        ("thigh.flexion", 40, "hip_flexion", 40),
        ("thigh.abduction", 25, "hip_adduction", -25),
        ("thigh.rotation", 20, "hip_internal_rotation", -20),
        ("shin.flexion", 70, "knee_flexion", 70),
        ("foot.dorsiflexion", 15, "ankle_dorsiflexion", 15),
        ("foot.eversion", 12, "ankle_inversion", -12),
        ("forearm.flexion", 90, "elbow_flexion", 90),
        ("forearm.pronation", 50, "forearm_pronation", 50),
        ("upper_arm.abduction", 30, "shoulder_elevation", 30),
        ("upper_arm.abduction", 30, "shoulder_adduction", -30),
        ("hand.flexion", 30, "wrist_flexion", 30),
    ],
)
def test_a_movement_counts_as_itself_on_both_sides(side, turn, by, name, change):
    moved, rest = angle({f"{side}_{turn}": by}, f"{side}_{name}"), angle({}, f"{side}_{name}")
    # Our hinges turn about the body's axes at rest; the thigh leans by a few degrees against them.
    assert moved - rest == pytest.approx(change, abs=1.5)


@pytest.mark.parametrize(
    ("turn", "name", "sign"),
    [
        ("flexion", "flexion", 1),
        ("lateral", "lateral_bending", None),
        ("rotation", "rotation", None),
    ],
)
def test_trunk(turn, name, sign):
    moved = angle({f"lumbar.{turn}": 20}, f"trunk_{name}")
    if sign is None:  # by geometry: to which side the neck goes, to which side the chest faces
        rotation, origin = posed({f"lumbar.{turn}": 20}).parts()
        chest = rotation[0, PART_NAMES.index("upper_thorax")]
        right = (
            origin[0, PART_NAMES.index("neck"), 0] < -0.05
            if turn == "lateral"
            else (chest @ [0, -1, 0])[0] > 0.1
        )
        sign = 1 if right else -1
    assert moved == pytest.approx(20 * sign, abs=0.01)


@pytest.mark.parametrize(
    ("turn", "name", "face", "toward"),
    [
        ("flexion", "flexion", False, [0, -1, 0]),  # the head goes forward
        ("lateral", "lateral_bending", False, [-1, 0, 0]),  # to the right
        ("rotation", "rotation", True, [1, 0, 0]),  # the face turns to the left
    ],
)
def test_neck(turn, name, face, toward):
    """By geometry: the sign is that of the movement which is seen."""

    def seen(motion: Motion) -> np.ndarray:
        rotation, origin = motion.parts()
        head = PART_NAMES.index("head")
        return rotation[0, head] @ [0, -1, 0] if face else origin[0, head]

    went = (seen(posed({f"neck.{turn}": 20})) - seen(posed({}))) @ toward
    assert abs(went) > 0.01
    assert angle({f"neck.{turn}": 20}, f"neck_{name}") == pytest.approx(20 * np.sign(went), abs=1)


@pytest.mark.parametrize("side", ["left", "right"])
def test_ulnar_deviation_leads_away_from_the_thumb(side):
    joint = dict(zip(BODY.names, BODY.joints_m, strict=True))
    thumb = joint[f"{side}_thumb"] - joint[f"{side}_hand"]
    turn, name = {f"{side}_hand.deviation": 20}, f"{side}_wrist_ulnar_deviation"
    fingers = PART_NAMES.index(f"{side}_fingers")
    went = posed(turn).parts()[1][0, fingers] - posed({}).parts()[1][0, fingers]
    away = -np.sign(went @ thumb)
    assert angle(turn, name) - angle({}, name) == pytest.approx(20 * away, abs=1.5)


@pytest.mark.parametrize("side", ["left", "right"])
def test_arm_forearm_and_hand_turn_about_the_axis_of_the_elbow(side):
    """As far as it is at right angles to the bone, in a body whose arm does not lie in a plane."""
    body = BODY.reshaped(2 * np.random.default_rng(2).normal(size=len(SHAPE_SIGMA)) * SHAPE_SIGMA)
    elbow = body.tree.dof_axis[body.tree.dof_names.index(f"{side}_forearm.flexion")]
    for part in ("upper_arm", "forearm", "hand"):
        _, up, right = segment_axes(body)[f"{side}_{part}"].T
        assert np.linalg.det([right, up, elbow]) == pytest.approx(0, abs=1e-9)
        assert right @ elbow > 0.5


@pytest.mark.parametrize("side", ["left", "right"])
def test_hands_and_feet_are_not_twisted_at_rest(side):
    """Fingers in line with the forearm, toes forward."""
    wrist = joint_rotations(posed({}))[f"{side}_wrist"][0]
    assert np.degrees(Rotation.from_matrix(wrist).magnitude()) < 10
    assert abs(angle({}, f"{side}_ankle_internal_rotation")) < 15


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_shin_that_slants_toward_the_other_leg_is_adducted(side):
    rest = BODY.landmarks_m
    hip, knee, ankle = (
        rest[LANDMARK_NAMES.index(f"{side}_{name}")] for name in ("hip", "knee", "ankle")
    )
    thigh, shin = (
        np.arctan2(abs(b[0]) - abs(a[0]), a[2] - b[2]) for a, b in pairwise((hip, knee, ankle))
    )
    inward = np.degrees(thigh - shin)
    assert abs(inward) > 0.3
    assert angle({}, f"{side}_knee_adduction") == pytest.approx(inward, abs=0.1)


def test_arms_forward_and_to_the_side():
    forward = {"right_upper_arm.abduction": -45, "right_upper_arm.forward": 0}
    assert angle(forward, "right_shoulder_elevation") == pytest.approx(0, abs=1)
    side = anatomical_angles(posed({"right_upper_arm.abduction": 30}))
    assert side["right_shoulder_plane_of_elevation"][0] == pytest.approx(0, abs=1)
    ahead = anatomical_angles(posed({"right_upper_arm.forward": 80}))
    assert 45 < ahead["right_shoulder_plane_of_elevation"][0] < 100
    assert ahead["right_shoulder_flexion"][0] > 45


@pytest.mark.parametrize(("heading", "expected"), [(0, 180), (180, 0), (90, -90), (-90, 90)])
def test_pelvis_in_the_world(heading, expected):
    # At rest the body faces -y; zero is facing +y.
    result = anatomical_angles(posed({}, heading))
    assert np.cos(np.radians(result["pelvis_rotation"][0] - expected)) == pytest.approx(1)
    assert abs(result["pelvis_tilt"][0]) < 1e-9


def test_pelvis_leans_the_same_whichever_way_it_faces():
    lean = Rotation.from_euler("x", 20, degrees=True)  # the body faces -y: its head goes forward
    for heading in (0, 70, 200):
        turned = (Rotation.from_euler("z", heading, degrees=True) * lean).as_quat(scalar_first=True)
        result = anatomical_angles(replace(posed({}), root_quaternion=turned[None]))
        assert result["pelvis_tilt"][0] == pytest.approx(20)
        assert result["pelvis_obliquity"][0] == pytest.approx(0, abs=1e-9)


def test_obliquity_raises_the_right_side():
    # About +y: from z toward x, so the right hip, at -x, goes up.
    raised = Rotation.from_euler("y", 15, degrees=True)
    result = replace(posed({}), root_quaternion=raised.as_quat(scalar_first=True)[None])
    hips = result.landmarks()[0, [4, 1], 2]
    assert hips[0] > hips[1]
    assert anatomical_angles(result)["pelvis_obliquity"][0] == pytest.approx(15)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_angles_make_the_rotations_again(seed):
    random = np.random.default_rng(seed)
    motion = replace(
        posed({}),
        angles_rad=random.uniform(BODY.tree.dof_limits_rad[:, 0], BODY.tree.dof_limits_rad[:, 1])[
            None
        ],
    )
    result, rotations = anatomical_angles(motion), joint_rotations(motion)
    for side in ("left", "right"):
        flexion, adduction, turn = (
            result[f"{side}_hip_{name}"][0]
            for name in ("flexion", "adduction", "internal_rotation")
        )
        again = Rotation.from_euler("ZXY", [flexion, adduction, turn], degrees=True).as_matrix()
        np.testing.assert_allclose(again, rotations[f"{side}_hip"][0], atol=1e-9)
        plane, elevation, axial = (
            result[f"{side}_shoulder_{name}"][0]
            for name in ("plane_of_elevation", "elevation", "axial_rotation")
        )
        again = Rotation.from_euler("YXY", [plane, -elevation, axial], degrees=True).as_matrix()
        np.testing.assert_allclose(again, rotations[f"{side}_shoulder"][0], atol=1e-9)
        assert elevation >= 0
    # the bones themselves: the angle at the knee between thigh and shin
    joints = landmarks(motion.model, *motion.parts())[0]
    thigh, shin = joints[4] - joints[5], joints[5] - joints[6]
    between = np.degrees(np.arccos(thigh @ shin / np.linalg.norm(thigh) / np.linalg.norm(shin)))
    knee = Rotation.from_euler(
        "ZX", [-result["right_knee_flexion"][0], result["right_knee_adduction"][0]], degrees=True
    ).as_matrix()
    assert np.degrees(np.arccos(knee[1, 1])) == pytest.approx(between, abs=1e-6)


def test_a_row_per_pose_and_every_angle_once():
    result = anatomical_angles(waving(4))
    assert result.degrees.shape == (4, len(result.names)) == (4, len(set(result.names)))
    assert np.isfinite(result.degrees).all()
    assert (np.diff(result["left_knee_flexion"]) > 20).all()
    assert (np.diff(result["right_shoulder_elevation"]) > 0).all()
