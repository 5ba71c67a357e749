"""Paper B's matcher: sampling within limits, movable areas, interference, the resulting posture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN, LANDMARK_NAMES, PART_NAMES
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.kinematics import forward, quaternions
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    groups_apart,
    hull,
    joint_errors_m,
    other_body,
    stance,
    views,
)
from voxelpose.multiview.matching.body_volume import BodyVolume, VoxelSet
from voxelpose.multiview.matching.joint_search import interference_groups
from voxelpose.multiview.matching.kernels.bits import count_common
from voxelpose.multiview.matching.limbs import LIMBS, sample_angles, sample_hinge, within_limits
from voxelpose.multiview.matching.matcher import LimbPlacements, MatchSettings, _Search, match

LIMB = {limb.name: limb for limb in LIMBS}
LOW, HIGH = HUMAN.dof_limits_rad.T
STEP = np.radians(15.0)
TURNS = {
    "left_upper_arm.abduction": 25.0,
    "right_upper_arm.abduction": 10.0,
    "left_thigh.flexion": 45.0,
    "left_shin.flexion": 70.0,
}


@pytest.fixture(scope="module")
def body_volume():
    return BodyVolume.from_model(fitting_model(), 0.025, "cpu")


@pytest.fixture(scope="module")
def scene():
    """Somebody else with both arms out to the sides and the left leg raised, and the hull that six
    cameras leave.
    """
    body = other_body(1)
    pose = stance(body, TURNS)
    return body, pose, *hull(views(), body, pose, 0.025)


def dofs_of(*names):
    return [k for k, dof in enumerate(HUMAN.dof_names) if dof.partition(".")[0] in names]


@given(st.sampled_from([limb for limb in LIMBS if limb.parent]), st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_samples_hold_the_present_angles_and_turn_the_limb_alone(limb, seed):
    angles = np.random.default_rng(seed).uniform(LOW, HIGH)
    result = sample_angles(limb, angles, STEP)
    np.testing.assert_array_equal(result[0], angles)
    assert within_limits(result).all()
    own = dofs_of(limb.name, limb.twist_of)
    np.testing.assert_array_equal(
        np.delete(result, own, 1), np.delete(result[:1] + 0 * result, own, 1)
    )
    if limb.swing:  # over the whole range the present twist means nothing
        swung = [HUMAN.dof_names.index(name) for name in limb.swing]
        assert not np.delete(result[1:, own], [own.index(k) for k in swung], 1).any()
        assert len(result) > 5


def test_a_full_search_reaches_both_ends_of_every_swing():
    for limb in LIMBS:
        for name in limb.swing:
            k = HUMAN.dof_names.index(name)
            angles = np.unique(sample_angles(limb, RELAXED_RAD, STEP)[1:, k])
            np.testing.assert_allclose([angles[0], angles[-1]], [LOW[k], HIGH[k]])
            assert np.diff(angles).max() <= STEP + 1e-9


@given(st.sampled_from([limb for limb in LIMBS if limb.hinge]), st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_twist_turns_the_bone_about_itself(body_volume, limb, seed):
    """Up to 100 degrees to either side; the bone above points where it pointed."""
    angles = np.random.default_rng(seed).uniform(LOW, HIGH)
    samples = sample_hinge(limb, angles[None], STEP)[0]
    above, root = LIMB[limb.twist_of], stance(body_volume.model)
    (own,), _ = body_volume.placements(above, root, angles[None])
    turned, _ = body_volume.placements(above, root, samples)
    kinds = ("twist", "rotation")
    axis = next(
        dof.axis for p, dof in HUMAN.dofs if PART_NAMES[p] == above.name and dof.name in kinds
    )
    np.testing.assert_allclose(turned @ axis, (own @ axis) + np.zeros((len(samples), 3)), atol=1e-9)
    twists = np.unique(np.round(Rotation.from_matrix(own.T @ turned).as_rotvec() @ axis, 6))
    np.testing.assert_allclose([twists[0], twists[-1]], np.radians([-100, 100]), atol=1e-5)
    assert np.diff(twists).max() <= 2 * STEP + 1e-5
    bends = np.unique(samples[:, HUMAN.dof_names.index(limb.hinge)])
    np.testing.assert_allclose([bends[0], bends[-1]], HUMAN.dof_limits_rad[dofs_of(limb.name)[0]])
    assert len(samples) == len(twists) * len(bends) and np.diff(bends).max() <= STEP + 1e-9


def test_limbs_are_placed_where_the_whole_body_would_have_them(body_volume):
    rng = np.random.default_rng(6)
    angles = rng.uniform(LOW, HIGH, (5, len(LOW)))
    move = np.r_[0.3, -0.2, 0.1, 0.5, -0.4, 1.0, np.zeros(len(LOW))]
    root = stance(body_volume.model).moved(move)
    quaternion = np.tile(quaternions(root.root_rotation), (5, 1))
    rotation, origin = forward(body_volume.model, np.tile(root.root_m, (5, 1)), quaternion, angles)
    for limb in LIMBS:
        rotations, origins = body_volume.placements(limb, root, angles)
        np.testing.assert_allclose(rotations, rotation[:, PART_NAMES.index(limb.name)], atol=1e-12)
        np.testing.assert_allclose(origins, origin[:, PART_NAMES.index(limb.name)], atol=1e-12)


def candidates_of(bits, limb="neck", cost=0, **more):
    words = np.packbits(np.asarray(bits, bool), axis=1, bitorder="little")
    words = np.pad(words, ((0, 0), (0, -words.shape[1] % 8))).view(np.uint64)
    angles = np.zeros((len(words), len(LOW)))
    return LimbPlacements(LIMB[limb], angles, words, np.broadcast_to(cost, len(words)), **more)


def test_movable_area_is_what_some_placement_covers():
    area = candidates_of([[1, 0, 0, 0], [0, 0, 1, 0]]).movable_area
    assert area[0] == 0b101


@pytest.mark.parametrize(
    ("cost", "spare", "area"),
    [((0, 1, 3), 0, 0b0111), ((2, 4, 3), 0, 0b1101), ((2, 4, 3), 1, 0b1111)],
)
def test_no_voxel_is_a_limbs_where_it_would_lie_mostly_elsewhere(cost, spare, area):
    """Placements that cost more than they explain do not count, unless the best combination may
    need them.
    """
    bits = [[1, 0, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1]]
    assert candidates_of(bits, cost=cost, spare=spare).movable_area[0] == area


def test_interference_is_passed_on_from_part_to_part():
    """The first meets the second and the second the third; the fourth meets nobody, though all four
    are tried at once.
    """
    areas = [[1, 1, 0, 0, 0, 0], [0, 1, 1, 0, 0, 0], [0, 0, 1, 1, 0, 0], [0, 0, 0, 0, 1, 0]]
    areas = [candidates_of([row]).movable_area for row in areas]
    assert interference_groups(areas) == [[0, 1, 2], [3]]
    assert count_common(areas[0], areas[1]) == 1


CROSSED = {
    f"{side}_{name}": angle
    for side, angles in (("left", (20.0, -14.0, 14.0)), ("right", (-5.0, -12.0, 14.0)))
    for name, angle in zip(
        ("thigh.flexion", "thigh.abduction", "shin.flexion"), angles, strict=True
    )
}
RAISED = {f"{side}_upper_arm.abduction": 150.0 for side in ("left", "right")}


@pytest.mark.parametrize(
    ("turns", "together"),
    [
        ({}, [{"left_thigh", "right_thigh"}]),
        (TURNS, [{"left_thigh", "right_thigh"}]),
        (CROSSED, [{"left_thigh", "right_thigh"}, {"left_shin", "right_shin"}]),
        (RAISED, [{"neck", "left_upper_arm", "right_upper_arm"}, {"left_thigh", "right_thigh"}]),
    ],
    ids=["upright", "raised leg", "crossed legs", "raised arms"],
)
def test_only_limbs_that_could_lie_in_each_others_voxels_are_matched_at_once(
    body_volume, turns, together
):
    body, start = other_body(1), stance(body_volume.model)
    scene = hull(views(), body, stance(body, turns), 0.025)
    result = match(body_volume, *scene, start)
    groups = [set(group) for group in result.groups]
    assert all(group in groups for group in together)
    assert {"left_forearm"} in groups or turns is RAISED
    assert sorted(name for group in groups for name in group) == sorted(limb.name for limb in LIMBS)
    plain = match(body_volume, *scene, start, MatchSettings(interference=False))
    assert all(len(group) == 1 for group in plain.groups)
    assert result.score >= plain.score


@pytest.mark.parametrize("turns", [{}, TURNS, CROSSED, RAISED])
def test_limbs_matched_apart_score_as_all_of_a_level_at_once(body_volume, turns):
    body, start = other_body(2), stance(body_volume.model)
    scene = hull(views(), body, stance(body, turns), 0.025)
    assert 1 < groups_apart(body_volume, start, *scene) < 5


@pytest.mark.parametrize("interference", [True, False])
def test_what_one_group_decides_outlasts_the_next(body_volume, scene, interference):
    """Every group of a level keeps its angles, however many groups follow it."""
    body, truth, grid, occupancy = scene
    start, chosen = stance(body_volume.model), MatchSettings(interference=interference)
    result = match(body_volume, grid, occupancy, start, chosen)
    errors_m = joint_errors_m(body_volume.model, result.pose, body, truth)
    # Both arms and the left leg are far from the stance that the search starts from.
    for name in ("left_elbow", "right_elbow", "left_knee"):
        assert errors_m[LANDMARK_NAMES.index(name)] < 0.12, name


def test_full_search_finds_the_postures_of_others(body_volume):
    """Four bodies of other shape in two postures, from the relaxed stance: joints to a few
    centimetres, and few limbs astray.
    """
    seated = {
        f"{side}_{name}": angle
        for side in ("left", "right")
        for name, angle in (("thigh.flexion", 80.0), ("shin.flexion", 85.0))
    }
    errors = []
    for seed, turns in ((0, TURNS), (1, seated), (2, TURNS), (4, seated)):
        body = other_body(seed)
        truth = stance(body, turns)
        result = match(body_volume, *hull(views(), body, truth, 0.025), stance(body_volume.model))
        errors.append(joint_errors_m(body_volume.model, result.pose, body, truth))
        assert within_limits(result.pose.angles_rad)
        # Six cameras leave a hull that is larger than the body.
        assert 0.5 < result.explained < 0.9
    assert np.mean(errors) < 0.06
    assert np.mean(np.array(errors) > 0.15) < 0.07


def test_points_in_empty_space_and_in_placed_parts_cost_what_is_said(body_volume, scene):
    _, _, grid, occupancy = scene
    settings, start = MatchSettings(), stance(body_volume.model)
    points = len(body_volume.points["left_thigh"])
    empty, full = (
        _Search([(body_volume, start)], grid, np.full_like(occupancy, there), settings)
        for there in (False, True)
    )
    limb, angles = LIMB["left_thigh"], start.angles_rad[None]
    assert empty.placements(0, limb, angles).cost == pytest.approx(points)
    placed = full.placements(0, limb, angles)
    assert placed.cost == 0
    full.decide([placed], (0,), [start.angles_rad])
    # Whatever is placed there again, all its points are taken.
    assert full.placements(0, limb, angles).cost == pytest.approx(0.7 * points)


@pytest.mark.parametrize("interference", [True, False])
def test_share_and_score_count_a_voxel_once(body_volume, scene, monkeypatch, interference):
    """Also one that several groups of a level claim."""
    _, _, grid, occupancy = scene
    costs, decide = [], _Search.decide

    def noted(search, group, choice, *others):
        costs.extend(float(one.cost[k]) for one, k in zip(group, choice, strict=True))
        return decide(search, group, choice, *others)

    monkeypatch.setattr(_Search, "decide", noted)
    start, chosen = stance(body_volume.model), MatchSettings(interference=interference)
    result = match(body_volume, grid, occupancy, start, chosen)
    voxel_set = VoxelSet(grid, occupancy, body_volume.backend)
    union = np.zeros(voxel_set.words, np.uint64)
    for limb in LIMBS:
        placed = body_volume.placements(limb, result.pose, result.pose.angles_rad[None])
        union |= voxel_set.cover(body_volume.points[limb.name], *placed)[0][0]
    share = np.bitwise_count(union).sum() / len(voxel_set)
    # A twist moves the bone above a little.
    assert result.explained == pytest.approx(share, abs=0.01)
    assert result.score == pytest.approx(result.explained * len(voxel_set) - sum(costs))


def test_same_answer_for_any_number_of_threads(body_volume, scene):
    from silhouette_core.jit import set_threads

    _, _, grid, occupancy = scene
    poses = []
    try:
        for threads in (1, 2):
            set_threads(threads)
            start, chosen = stance(body_volume.model), MatchSettings(step_rad=np.radians(25.0))
            poses.append(match(body_volume, grid, occupancy, start, chosen).pose.angles_rad)
    finally:
        set_threads(None)
    np.testing.assert_array_equal(*poses)


def test_an_empty_hull_leaves_the_pose_as_it_was(body_volume):
    grid, occupancy = hull(views(2), other_body(), stance(other_body()))
    start, chosen = stance(body_volume.model), MatchSettings(step_rad=np.radians(40.0))
    result = match(body_volume, grid, np.zeros_like(occupancy), start, chosen)
    assert result.explained == 0 and within_limits(result.pose.angles_rad)
