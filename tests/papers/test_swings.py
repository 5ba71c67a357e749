"""Criterion and table of the arm-swing experiment, and degradation of silhouettes."""

from itertools import pairwise

import numpy as np
import pytest

from calib.errors import InputError
from papers.arm_swing import METHODS, Row, Truth
from papers.degrade import Degradation, degrade
from papers.swing_report import draw_angles, swing_table
from papers.swings import VERDICTS, arm_angles, count, judge, split_swings
from silhouette_core.body.joints import LANDMARK_NAMES

SWING = np.concatenate([np.linspace(-55, 75, 13)[:-1], np.linspace(75, -55, 13)[:-1]])


def joints(angle_deg, yaw_deg=0.0, out_deg=0.0):
    """Joints of an upright body whose right upper arm is raised forward; at yaw 0 it faces -y."""
    angle, out, yaw = np.radians([angle_deg, out_deg, yaw_deg])
    joints_m = np.zeros((1, len(LANDMARK_NAMES), 3))
    arm = np.array([-np.sin(out), -np.sin(angle) * np.cos(out), -np.cos(angle) * np.cos(out)])
    for name, position in (
        ("left_shoulder", (0.2, 0, 1.4)),
        ("right_shoulder", (-0.2, 0, 1.4)),
        ("right_elbow", (-0.2, 0, 1.4) + 0.3 * arm),
    ):
        joints_m[0, LANDMARK_NAMES.index(name)] = position
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return joints_m @ turn.T


@pytest.mark.parametrize("yaw", [0, 90, 200])
@pytest.mark.parametrize("angle", [-50, 0, 30, 120])
def test_arm_angle_is_forward_swing_whichever_way_the_body_faces(angle, yaw):
    assert arm_angles(joints(angle, yaw)) == pytest.approx(angle)
    assert arm_angles(joints(angle, yaw, out_deg=25)) == pytest.approx(angle)


def test_left_arm_has_its_own_angle():
    body = joints(40)
    body[0, LANDMARK_NAMES.index("left_elbow")] = (0.2, 0.3, 1.4)
    assert arm_angles(body, "left") == pytest.approx(-90)


def test_swings_are_divided_at_the_backmost_angle():
    swings = split_swings(np.tile(SWING, 5))
    assert [(swing.start, swing.stop) for swing in swings] == [
        (24 * k, 24 * k + 24) for k in range(5)
    ]
    shaky = np.tile(SWING, 5) + np.random.default_rng(0).normal(0, 2, 120)
    assert len(split_swings(shaky)) == 5
    assert all(a.stop == b.start for a, b in pairwise(split_swings(shaky)))


def test_part_of_a_swing_does_not_count():
    assert len(split_swings(np.tile(SWING, 4)[5:80])) == 2


def test_arm_that_hangs_is_refused():
    with pytest.raises(InputError, match="4 degrees only"):
        split_swings(np.tile([0.0, 4.0], 30))


@pytest.mark.parametrize(
    ("estimate", "verdict"),
    [
        (SWING, "success"),
        (SWING + 15, "success"),
        (0.8 * SWING, "success"),
        (SWING + 25, "error"),
        (np.where(np.arange(24) == 5, SWING + 70, SWING), "error"),
        (np.full(24, -40.0), "fail"),
        (-SWING, "fail"),
        (0.3 * SWING, "fail"),
        (np.roll(SWING, 4), "fail"),
        (np.where(np.arange(24) == 5, np.nan, SWING), "fail"),
    ],
)
def test_verdicts(estimate, verdict):
    assert judge(SWING, estimate) == verdict


def test_angles_beyond_the_half_turn_are_near_each_other():
    truth = np.linspace(100, 178, 20)
    assert judge(truth, (truth + 10 + 180) % 360 - 180) == "success"


def test_counts_add_up():
    truth = np.tile(SWING, 3)
    estimate = np.concatenate([SWING, SWING + 30, np.zeros(24)])
    assert count(truth, estimate, split_swings(truth)) == {"fail": 1, "error": 1, "success": 1}


def test_the_table_has_the_papers_counts():
    method = METHODS[3]
    rows = [
        Row(str(method), silhouettes, dict(zip(VERDICTS, counts, strict=True)), SWING, *others)
        for silhouettes, counts, others in (
            ("as found", (0, 3, 21), (9.87, 0, method.paper)),
            ("4 holes of radius 8 px", (24, 0, 0), (51.0,)),
        )
    ]
    lines = swing_table(rows).splitlines()
    assert lines[2] == "| as found | nwXOR+DM2 | 0 | 3 | 21 | 0 / 10 / 14 | 9.9 |"
    assert lines[3] == "| 4 holes of radius 8 px | nwXOR+DM2 | 24 | 0 | 0 | – | 51.0 |"
    assert len({line.count("|") for line in lines}) == 1


def test_plot_is_drawn(tmp_path):
    truth = np.tile(SWING, 8)
    rows = [Row("nwXOR+DM1", "as found", {"fail": 0, "error": 0, "success": 8}, truth + 5, 5.0)]
    draw_angles(rows, Truth(truth, split_swings(truth)), 15.0, tmp_path / "angles.png")
    assert (tmp_path / "angles.png").stat().st_size > 5000


MASK = np.zeros((120, 160), bool)
MASK[20:100, 60:100] = True


def test_contour_moves_by_the_requested_distance():
    degraded = degrade(MASK, Degradation(contour_px=3.0), np.random.default_rng(0))
    inner, outer = MASK[32:88, 72:88], np.pad(np.zeros((56, 16), bool), 0)
    assert degraded[32:88, 72:88].sum() > 0.99 * inner.sum()
    assert not outer.any()
    # Along the left side, the contour's mean stays and its standard deviation is about 3 px.
    left = np.array([np.flatnonzero(row)[0] for row in degraded[35:85]])
    assert abs(left.mean() - 60) < 3
    assert 1.0 < left.std() < 6.0
    assert not degrade(MASK, Degradation(contour_px=3.0), np.random.default_rng(0))[:, 130:].any()


def test_holes_have_the_requested_size():
    degraded = degrade(MASK, Degradation(holes=1, hole_radius_px=5.0), np.random.default_rng(2))
    assert not (degraded & ~MASK).any()
    assert 20 <= (MASK & ~degraded).sum() <= 81


def test_same_seed_same_silhouette():
    degradation = Degradation(contour_px=2.0, holes=3, hole_radius_px=4.0)
    first, second, other = (
        degrade(MASK, degradation, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert (first == second).all()
    assert (first != other).any()


def test_no_degradation_changes_nothing():
    assert (degrade(MASK, Degradation(), np.random.default_rng(0)) == MASK).all()
    degradation = Degradation(contour_px=2.0, holes=2, hole_radius_px=3.0)
    assert not degrade(np.zeros_like(MASK), degradation, np.random.default_rng(0)).any()


def test_description_of_degradation_has_its_sizes():
    assert str(Degradation()) == "as found"
    assert (
        str(Degradation(2.0, 4.0, 3, 8.0))
        == "contour moved by 2 px (grain 4 px), 3 holes of radius 8 px"
    )
