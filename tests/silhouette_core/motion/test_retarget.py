"""Recorded motion on our body: limbs point where the recorded ones did."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.kinematics import landmarks, skin
from silhouette_core.motion.mocap import load_motions, read_clip, retarget
from silhouette_core.motion.motion import Motion
from tests.clips import waving
from voxelpose.export.bvh import write_bvh

BONES = [
    (s + a, s + b)
    for s in ("left_", "right_")
    for a, b in (("upper_arm", "forearm"), ("forearm", "hand"), ("thigh", "shin"), ("shin", "foot"))
]


def directions(places, index, bones=BONES):
    lines = np.stack(
        [places[:, index(far)] - places[:, index(near)] for near, far in bones], axis=1
    )
    return lines / np.linalg.norm(lines, axis=-1, keepdims=True)


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(-1), -1, 1)))


def standing_then(motion: Motion) -> Motion:
    """Puts a second of standing at rest before a motion."""
    root_m, quaternion, angles = motion.root_m, motion.root_quaternion, motion.angles_rad
    root_m, quaternion = (np.vstack([one[:1].repeat(6, 0), one]) for one in (root_m, quaternion))
    angles = np.vstack([np.zeros((6, angles.shape[1])), angles])
    return Motion(motion.fps, motion.model, root_m, quaternion, angles)


def test_our_own_bvh_comes_back(tmp_path):
    motion = standing_then(waving(12))
    write_bvh(motion, tmp_path / "own.bvh")
    again = retarget(read_clip(tmp_path / "own.bvh"), motion.model)
    assert len(again) == len(motion)
    index = motion.model.names.index
    ours, theirs = (directions(one.parts()[1], index) for one in (motion, again))
    assert degrees_between(ours, theirs).max() < 3
    turn = Rotation.from_quat(again.root_quaternion, scalar_first=True).inv() * Rotation.from_quat(
        motion.root_quaternion, scalar_first=True
    )
    assert np.degrees(turn.magnitude()).max() < 3
    path = (again.root_m - again.root_m[0]) - (motion.root_m - motion.root_m[0])
    assert np.abs(path[:, :2]).max() < 0.005


def test_z_up_files_and_other_units_make_no_difference(tmp_path):
    motion = standing_then(waving(8))
    write_bvh(motion, tmp_path / "own.bvh")
    recorded = read_clip(tmp_path / "own.bvh")
    upright = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    inches = recorded.posed(upright @ recorded.rotations, recorded.positions @ upright.T / 2.54)
    inches = type(inches)(**{**inches.__dict__, "offsets": inches.offsets / 2.54})
    ours, theirs = retarget(recorded, motion.model), retarget(inches, motion.model)
    np.testing.assert_allclose(theirs.angles_rad, ours.angles_rad, atol=0.02)
    np.testing.assert_allclose(theirs.root_m, ours.root_m, atol=0.005)


def test_limits_hold_and_neighbours_take_over(tmp_path):
    model = BodyModel.from_sizes(BodySizes(1.7))
    motion = waving(8)
    # The spine bends to its limit everywhere, which leaves the neck to look ahead and the hips to
    # do what the legs need.
    motion.angles_rad[:, model.tree.dof_names.index("thorax.flexion")] = np.radians(60)
    write_bvh(standing_then(motion), tmp_path / "bent.bvh")
    again = retarget(read_clip(tmp_path / "bent.bvh"), model)
    low, high = model.tree.dof_limits_rad.T
    assert (again.angles_rad >= low - 1e-9).all() and (again.angles_rad <= high + 1e-9).all()
    lumbar = again.angles_rad[-1, model.tree.dof_names.index("lumbar.flexion")]
    assert lumbar > np.radians(18)  # recorded: 15 degrees
    index = model.names.index
    arms = [bone for bone in BONES if "arm" in bone[0]]
    recorded = directions(standing_then(motion).parts()[1], index, arms)
    assert degrees_between(recorded, directions(again.parts()[1], index, arms)).max() < 3


def test_feet_touch_the_floor_but_in_jumps(tmp_path):
    motion = standing_then(waving(12))
    motion.angles_rad[:] = 0
    motion.root_quaternion[:] = (1, 0, 0, 0)
    lift = np.zeros(len(motion))
    lift[10:14] = 0.4
    motion.root_m[:, 2] = motion.model.joints_m[0, 2] + lift
    write_bvh(motion, tmp_path / "jump.bvh")
    again = retarget(read_clip(tmp_path / "jump.bvh"), motion.model)
    lowest = np.array(
        [skin(motion.model, *pose)[:, 2].min() for pose in zip(*again.parts(), strict=True)]
    )
    np.testing.assert_allclose(lowest[lift == 0], 0, atol=0.003)
    np.testing.assert_allclose(lowest[lift > 0], 0.4, atol=0.05)


def test_t_pose_before_the_motion_is_left_out(tmp_path):
    motion = waving(12)
    motion.angles_rad[0] = 0
    sides = "left", "right"
    left, right = (motion.model.tree.dof_names.index(f"{s}_upper_arm.abduction") for s in sides)
    motion.angles_rad[0, [left, right]] = np.radians(45)
    motion.angles_rad[1:, left] = np.radians(-40)
    write_bvh(motion, tmp_path / "t.bvh")
    assert len(retarget(read_clip(tmp_path / "t.bvh"), motion.model)) == 11


@pytest.mark.parametrize(
    "clip", ["cmu_bvh/002_07.bvh", "cmu_bvh/007_04.bvh", "cmu_expmap/test_basketball_1.csv"]
)
def test_limbs_point_where_the_recorded_ones_did(shared, clip):
    recorded = read_clip(shared / "data/mocap" / clip).at_rate(30)
    motion = retarget(recorded, BodyModel.from_sizes(BodySizes(1.75)))
    world = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # y up to z up
    theirs = directions(recorded.positions[-len(motion) :] @ world.T, recorded.roles.__getitem__)
    error = degrees_between(theirs, directions(motion.parts()[1], motion.model.names.index))
    assert np.median(error) < 1 and np.percentile(error, 95) < 4


@pytest.mark.parametrize(
    ("recording", "clip", "first_frame", "joints_mm"),
    [
        ("walk4", "cmu_bvh/007_01.bvh", 1, 60),
        ("dance8", "cmu_bvh/005_06.bvh", 61, 55),
        ("traffic4", "cmu_expmap/train_directing_traffic_1.csv", 29, 25),
    ],
)
def test_agrees_with_another_program_that_retargeted_the_same_clip(
    shared, recording, clip, first_frame, joints_mm
):
    truth = json.loads((shared / "data" / recording / "truth.json").read_text())
    wanted = np.stack([truth["joints"][name] for name in LANDMARK_NAMES], axis=1).astype(float)
    (motion,) = load_motions(
        [shared / "data/mocap" / clip], BodyModel.from_sizes(BodySizes(truth["stature"]))
    )
    motion = motion.select(slice(first_frame, first_frame + len(wanted)))
    result = landmarks(motion.model, *motion.parts())
    relative = (result - result[:, :1]) - (wanted - wanted[:, :1])
    assert 1e3 * np.linalg.norm(relative, axis=-1).mean() < joints_mm
    hips = lambda places: np.unwrap(np.arctan2(*(places[:, 1] - places[:, 4])[:, 1::-1].T))  # noqa: E731
    turned = hips(result) - hips(wanted)
    assert np.degrees(np.abs(turned)).max() < 12
