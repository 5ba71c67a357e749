"""Criterion and table of the arm-swing experiment."""

from itertools import pairwise

import numpy as np
import pytest

from calib.errors import InputError
from papers.arm_swing import METHODS, Case, Row
from papers.swing_film import SwingFilm
from papers.swing_report import draw_angles, swing_table
from papers.swing_study import Side
from papers.swings import VERDICTS, arm_angles, count, judge, split_swings
from silhouette_core.body.joints import LANDMARK_NAMES
from tests.silhouette_core.monocular.filming import camera_at

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


def film(swings=8):
    truth = np.tile(SWING, swings)
    return SwingFilm(camera_at((0, -3, 1)), np.zeros((len(truth), 480, 80), np.uint8), truth)


def test_the_table_adds_up_the_films_and_has_the_papers_counts():
    case = Case(METHODS[3], "density", 0.02)
    rows = [
        Row(case, dict(zip(VERDICTS, counts, strict=True)), SWING, error)
        for counts, error in (((0, 3, 21), 9.87), ((1, 0, 23), 12.0))
    ]
    sides = [Side(False, rows=[rows])]
    lines = swing_table(sides).splitlines()
    assert lines[2] == (
        "| far | density | nwXOR+DM2 | 0.02 | 1 | 3 | 44 | 0 / 10 / 14 | 10.9, 9.9, 12.0 |"
    )
    assert len({line.count("|") for line in lines}) == 1


def test_plot_is_drawn(tmp_path):
    shown = film()
    counts = {"fail": 0, "error": 0, "success": 8}
    rows = [Row(Case(METHODS[2], "kernel", 0.02), counts, shown.truth_deg + 5, 5.0)]
    draw_angles(rows, shown, 15.0, tmp_path / "angles.png")
    assert (tmp_path / "angles.png").stat().st_size > 5000
