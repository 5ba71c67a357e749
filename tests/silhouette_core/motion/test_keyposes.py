"""The project's own movements: they do what their names say, and stay human."""

import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.heading import mirrored
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.motion.keyposes.notation import COLUMNS, STANDING, movements
from silhouette_core.motion.kinematics import skin

MODEL = BodyModel.from_sizes(BodySizes(1.7))


@pytest.fixture(scope="module")
def motions():
    return keypose_motions(MODEL)


def place(motion, landmark):
    return motion.landmarks()[:, LANDMARK_NAMES.index(landmark)]


def test_enough_of_everything(motions):
    assert 3000 <= sum(len(motion) for motion in motions.values()) <= 6500
    names = " ".join(motions)
    required = (
        "arm swing,turn,walk,march,side step,reach,point,golf,squat,wave,punch,jumping jack,sit,"
        "bend,folded,hips,kick"
    )
    assert all(name in names for name in required.split(","))


def test_limits_hold_and_nothing_leaps(motions):
    low, high = MODEL.tree.dof_limits_rad.T
    for name, motion in motions.items():
        assert (motion.angles_rad >= low - 1e-9).all() and (
            motion.angles_rad <= high + 1e-9
        ).all(), name
        assert np.degrees(np.abs(np.diff(motion.angles_rad, axis=0)).max()) < 40, name
        assert np.linalg.norm(np.diff(motion.root_m, axis=0), axis=1).max() * motion.fps < 3, name


def test_lower_foot_stands_on_the_floor(motions):
    for name in ("squat 1", "walk 2", "golf swing 1", "sit down 1"):
        motion = motions[name]
        for row in range(0, len(motion), 15):
            posed = skin(MODEL, *(array[0] for array in motion.select(slice(row, row + 1)).parts()))
            assert abs(posed[:, 2].min()) < 0.02, (name, row)


def test_movements_do_what_their_names_say(motions):
    def hand(name, side="right"):
        return place(motions[name], f"{side}_wrist") - place(motions[name], f"{side}_shoulder")

    swing = hand("arm swing right 1")
    assert (
        swing[:, 1].min() < -0.4
        and swing[:, 1].max() > 0.3
        and np.abs(hand("arm swing right 1", "left")[:, 1]).max() < 0.2
    )
    assert hand("reach up 1")[:, 2].max() > 0.45
    assert hand("point 1")[30, 1] < -0.45 and hand("point 1")[:, 0].min() < -0.45
    assert place(motions["squat 1"], "pelvis")[:, 2].min() < 0.6
    assert place(motions["kick 1"], "right_ankle")[:, 2].max() > 0.6
    walk = motions["walk 1"]
    assert walk.root_m[-1, 1] < -1.0
    turned = np.unwrap(
        2
        * np.arctan2(
            motions["turn on the spot 1"].root_quaternion[:, 3],
            motions["turn on the spot 1"].root_quaternion[:, 0],
        )
    )
    assert np.degrees(turned[-1] - turned[0]) == pytest.approx(360, abs=1)


def test_same_seed_same_motions(motions):
    first, again = motions["squat 2"].angles_rad, keypose_motions(MODEL)["squat 2"].angles_rad
    np.testing.assert_array_equal(again, first)
    other = keypose_motions(MODEL, seed=1)["squat 2"].angles_rad
    assert np.abs(other[0] - first[0]).max() > 0.01


def test_second_half_of_a_cycle_is_the_mirror_image_of_the_first(motions):
    walk = motions["walk 1"]
    times = np.array([0.0, 0.1, 0.3])
    early, late = (np.rint(t * 30).astype(int) for t in (times, times + 0.55))
    other = mirrored(walk.select(early))
    # 0.55 s is not a whole number of frames.
    assert np.abs(other.angles_rad - walk.select(late).angles_rad).max() < np.radians(12)


def test_notation():
    table = movements()["squat"]
    pose = dict(zip(COLUMNS, table.poses_deg[2], strict=True))
    assert (pose["l.hip"], pose["r.knee"], pose["nod"], pose["twist"]) == (112, 125, -10, 0)
    np.testing.assert_array_equal(table.poses_deg[0], STANDING)
    assert (np.diff(table.times_s) > 0).all()
