"""Limbs of bodies that are no person's, and the matching of their parts."""

from functools import partial

import numpy as np
import pytest

from examples.bodies.example_bodies import person_with_stick, quadruped, robot_arm, spider
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigid_parts import Box, Capsule, body_of_parts
from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.pose import Pose
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    groups_apart,
    hull,
    joint_errors_m,
    views,
)
from voxelpose.multiview.matching import joint_search, matcher
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.limbs import CHAINS, LIMBS, sample_angles, within_limits
from voxelpose.multiview.matching.matcher import MatchSettings, match

ROBOT, DOG, SPIDER = robot_arm(), quadruped(), spider()
VOXEL_M = 0.03
LEGS = tuple(f"{side}_{end}_upper" for end in ("fore", "hind") for side in ("left", "right"))


def posed(model: BodyModel, turns_deg: dict[str, float]) -> Pose:
    angles = relaxed_rad(model.tree).copy()
    for name, degrees in turns_deg.items():
        angles[model.tree.dof_names.index(name)] = np.radians(degrees)
    return Pose(model.joints_m[0], np.eye(3), angles)


def test_a_turn_that_does_not_show_is_sampled_with_the_next_part():
    limbs = BodyVolume.from_model(ROBOT, VOXEL_M, "cpu").limbs
    assert [(limb.name, limb.parts, limb.angles) for limb in limbs] == [
        ("world", ("world", "turret"), ()),
        ("upper_arm", ("upper_arm",), ("turret.shoulder_pan", "upper_arm.shoulder_lift")),
        ("forearm", ("forearm", "wrist_1"), ("forearm.elbow",)),
        ("wrist_2", ("wrist_2",), ("wrist_1.wrist_roll", "wrist_2.wrist_bend")),
        ("gripper", ("gripper",), ("gripper.gripper_roll",)),
    ]
    parents = [limb.parent for limb in limbs]
    assert parents == [None, "world", "upper_arm", "forearm", "wrist_2"]


def test_of_several_limbs_the_largest_that_it_moves_shows_a_turn():
    """A turret whose turn does not show carries two arms; the crane beside it does not turn."""
    pitch = (Dof("pitch", (1.0, 0.0, 0.0), (-60.0, 60.0)),)
    yaw = (Dof("yaw", (0.0, 0.0, 1.0), (-120.0, 120.0)),)
    tree = KinematicTree.from_parts(
        (
            ("base", "", ()),
            ("turret", "base", yaw),
            ("small", "turret", pitch),
            ("large", "turret", pitch),
            ("crane", "base", pitch),
        )
    )
    joints = np.array([[0, 0, 0], [0, 0, 0.3], [0.1, 0, 0.5], [-0.1, 0, 0.5], [0, 0.5, 0.2]])
    shapes = [
        [Box((-0.3, -0.3, 0), (0.3, 0.6, 0.2))],
        [Capsule((0, 0, 0.35), (0, 0, 0.5), 0.12)],
        [Capsule((0.1, -0.1, 0.5), (0.1, -0.4, 0.5), 0.05)],
        [Capsule((-0.1, -0.1, 0.5), (-0.1, -0.7, 0.5), 0.06)],
        [Capsule((0, 0.5, 0.3), (0, 0.5, 1.5), 0.1)],
    ]
    limbs = BodyVolume.from_model(body_of_parts(tree, joints, shapes), VOXEL_M, "cpu").limbs
    assert {limb.name: (limb.parent, limb.angles) for limb in limbs} == {
        "base": (None, ()),
        "small": ("large", ("small.pitch",)),
        "large": ("base", ("turret.yaw", "large.pitch")),
        "crane": ("base", ("crane.pitch",)),
    }


def test_all_limbs_of_an_animal_begin_at_its_trunk():
    volume = BodyVolume.from_model(DOG, VOXEL_M, "cpu")
    first = [limb.name for limb in volume.limbs if limb.parent == "trunk"]
    assert sorted(first) == sorted(("neck", "tail", *LEGS))
    assert sum(len(limb.parts) for limb in volume.limbs) == len(DOG.names)
    chains = [tuple(limb.name for limb in chain) for chain in volume.chains]
    assert ("tail",) in chains and ("left_hind_upper", "left_hind_lower") in chains
    assert len(chains) == 10


def test_a_person_keeps_its_limbs_and_carries_what_is_added():
    volume = BodyVolume.from_model(fitting_model(), 0.05, "cpu")
    assert volume.limbs == LIMBS and volume.chains == CHAINS and volume.is_person
    armed = BodyVolume.from_model(person_with_stick(), 0.05, "cpu")
    forearm = next(limb for limb in armed.limbs if limb.name == "right_forearm")
    assert forearm.parts[-1] == "stick" and armed.is_person
    assert len(armed.points["right_forearm"]) > len(volume.points["right_forearm"])


@pytest.mark.parametrize("model", [ROBOT, DOG], ids=["robot", "dog"])
@pytest.mark.parametrize("step_deg", [15.0, 0.5])
def test_samples_stay_within_limits_and_are_bounded(model, step_deg):
    middle = relaxed_rad(model.tree)
    for limb in BodyVolume.from_model(model, 0.05, "cpu").limbs[1:]:
        found = sample_angles(limb, middle, np.radians(step_deg), model.tree)
        np.testing.assert_array_equal(found[0], middle)
        assert within_limits(found, model.tree).all() and 5 < len(found) <= 2501
        own = [model.tree.dof_names.index(name) for name in limb.angles]
        assert (np.delete(found, own, 1) == np.delete(middle, own)).all()
        for k in own:
            np.testing.assert_allclose(
                [found[1:, k].min(), found[1:, k].max()], model.tree.dof_limits_rad[k]
            )


def test_a_robot_is_matched_part_by_part():
    truth = posed(ROBOT, {
        "turret.shoulder_pan": 40.0, "upper_arm.shoulder_lift": -30.0, "forearm.elbow": 40.0,
        "wrist_2.wrist_bend": 50.0,
    })  # fmt: skip
    volume = BodyVolume.from_model(ROBOT, VOXEL_M, "cpu")
    start = Pose(truth.root_m, truth.root_rotation, relaxed_rad(ROBOT.tree))
    found = match(volume, *hull(views(), ROBOT, truth, VOXEL_M), start)
    assert joint_errors_m(ROBOT, start, ROBOT, truth).max() > 0.5
    assert joint_errors_m(ROBOT, found.pose, ROBOT, truth).max() < 0.12
    assert found.groups[0] == ("world",) and not found.stopped


def sprawled(seed: int) -> Pose:
    """The spider with its legs anywhere."""
    low, high = 0.9 * SPIDER.tree.dof_limits_rad.T
    angles = np.random.default_rng(seed).uniform(low, high)
    return Pose(SPIDER.joints_m[0], np.eye(3), angles)


@pytest.mark.parametrize(("seed", "largest"), [(0, 2), (1, 1), (4, 2)])
def test_legs_that_interfere_are_matched_together(seed, largest):
    volume, truth = BodyVolume.from_model(SPIDER, VOXEL_M, "cpu"), sprawled(seed)
    start = Pose(truth.root_m, truth.root_rotation, relaxed_rad(SPIDER.tree))
    seen = hull(views(), SPIDER, truth, VOXEL_M)
    found = match(volume, *seen, start)
    assert max(len(set(LEGS) & set(group)) for group in found.groups) == largest
    assert groups_apart(volume, start, *seen) <= 5 - largest and not found.stopped
    alone = match(volume, *seen, start, MatchSettings(interference=False))
    assert all(len(group) == 1 for group in alone.groups)
    for result in (found, alone):
        assert within_limits(result.pose.angles_rad, SPIDER.tree)
    assert joint_errors_m(SPIDER, found.pose, SPIDER, truth).mean() < 0.09


def test_a_stopped_search_is_told_with_its_group(monkeypatch):
    volume, truth = BodyVolume.from_model(SPIDER, VOXEL_M, "cpu"), sprawled(0)
    start = Pose(truth.root_m, truth.root_rotation, relaxed_rad(SPIDER.tree))
    small = partial(joint_search.best_together, most_bytes=0)
    monkeypatch.setattr(matcher, "best_together", small)
    found = match(volume, *hull(views(2), SPIDER, truth, VOXEL_M), start)
    assert found.stopped and set(found.stopped) <= set(found.groups)
    assert all(len(group) > 1 for group in found.stopped)


def ball_arm() -> BodyModel:
    """An upper arm in a ball joint, whose turn about itself shows in the forearm alone."""
    ball = tuple(
        Dof(name, axis, (-120.0, 120.0))
        for name, axis in (("x", (1.0, 0, 0)), ("y", (0, 1.0, 0)), ("twist", (0, 0, 1.0)))
    )
    tree = KinematicTree.from_parts(
        (
            ("case", "", ()),
            ("upper", "case", ball),
            ("fore", "upper", (Dof("bend", (1.0, 0, 0), (0.0, 140.0)),)),
        )
    )
    joints = np.array([[0, 0, 0.4], [0, 0, 0.75], [0, 0, 1.15]])
    shapes = [
        [Box((-0.2, -0.3, 0.0), (0.2, 0.3, 0.7))],
        [Capsule((0, 0, 0.78), (0, 0, 1.12), 0.06)],
        [Capsule((0, 0, 1.16), (0, 0, 1.5), 0.05)],
    ]
    return body_of_parts(tree, joints, shapes)


def test_a_twist_leaves_the_bone_above_where_it_points():
    arm = ball_arm()
    volume = BodyVolume.from_model(arm, VOXEL_M, "cpu")
    _, upper, fore = volume.limbs
    assert upper.angles == ("upper.x", "upper.y")
    assert fore.angles == ("upper.twist", "fore.bend")
    swung = posed(arm, {"upper.x": 70.0, "upper.y": -30.0})
    samples = sample_angles(fore, swung.angles_rad, np.radians(20), arm.tree)
    assert len(samples) > 30 and within_limits(samples, arm.tree).all()
    assert np.ptp(samples[:, 2]) > np.radians(90)
    rotation, _ = volume.placements(upper, swung, samples)
    np.testing.assert_allclose(
        rotation[:, :, 2], rotation[:1, :, 2].repeat(len(samples), 0), atol=1e-9
    )
    assert np.ptp(volume.placements(fore, swung, samples)[0][:, :, 2], axis=0).max() > 0.5
    # Over its whole range, whatever it was.
    twisted = sample_angles(fore, posed(arm, {"upper.twist": 50.0}).angles_rad, 0.5, arm.tree)
    twists = np.unique(np.degrees(twisted[1:, 2]).round(6))
    np.testing.assert_allclose([twists[0], twists[-1]], [-120, 120])


def test_an_arm_in_a_ball_joint_is_matched():
    arm = ball_arm()
    truth = posed(arm, {"upper.x": 60.0, "upper.y": 25.0, "upper.twist": 70.0, "fore.bend": 80.0})
    start = Pose(truth.root_m, truth.root_rotation, relaxed_rad(arm.tree))
    volume = BodyVolume.from_model(arm, VOXEL_M, "cpu")
    found = match(volume, *hull(views(), arm, truth, VOXEL_M), start).pose
    tip = np.array([[0.0, 0.0, 0.35]])
    ends = [
        turn @ tip[0] + place
        for turn, place in (
            tuple(one[0] for one in volume.placements(volume.limbs[2], pose, pose.angles_rad[None]))
            for pose in (found, truth)
        )
    ]
    assert np.linalg.norm(ends[0] - ends[1]) < 0.15
