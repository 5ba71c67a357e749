"""Gait of walkers whose footsteps are known, and of people who do not walk."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.motion.gait import WalkerPoints, _bouts, _gait_of, find_gait, walker_points
from silhouette_core.motion.gait_values import SIDES, Spread, Stride, normalised_cycles
from tests.clips import waving

FPS, STEP_S, LEFT_M, RIGHT_M, WIDTH_M, SWING = 30, 0.55, 0.62, 0.5, 0.16, 0.4
FOOT_M, HEIGHT_M = 0.2, 0.92
STRIDE_S, STRIDE_M = 2 * STEP_S, LEFT_M + RIGHT_M


def walker(seconds=6.0, heading_deg=30.0, pace=1.0, reach=1.0, facing_deg=0.0) -> WalkerPoints:
    """A walker along a heading whose left steps are longer than the right ones.

    Contacts of the left foot are at 0, 1.1 s …, of the right one half a stride later; feet stand
    for 60 % of a stride and swing evenly. `pace` is how much faster, `reach` how much
    farther steps go.
    """
    time_s = pace * np.arange(0, seconds, 1 / FPS)
    pelvis = np.column_stack([time_s * STRIDE_M / STRIDE_S, 0 * time_s, HEIGHT_M + 0 * time_s])
    heels = np.empty((len(time_s), 2, 3))
    for side, (start_s, start_m, aside) in enumerate(
        ((0.0, 0.3, WIDTH_M / 2), (STEP_S, 0.3 + RIGHT_M, -WIDTH_M / 2))
    ):
        phase = (time_s - start_s) / STRIDE_S
        swing = np.clip((phase % 1 - (1 - SWING)) / SWING, 0, 1)
        heels[:, side, 0] = start_m + STRIDE_M * (np.floor(phase) + swing)
        heels[:, side, 1] = aside
        heels[:, side, 2] = 0.05 * np.sin(np.pi * swing)
    turn = np.radians(heading_deg)
    world = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    for points in (pelvis, heels):
        points[..., :2] = reach * points[..., :2] @ world.T
    toes = heels + FOOT_M * np.array([*world[:, 0], 0])
    facing = turn + np.radians(facing_deg)
    ahead = np.tile([np.cos(facing), np.sin(facing)], (len(time_s), 1))
    return WalkerPoints(time_s / pace, pelvis, ahead, heels, toes)


def test_a_walker_has_the_steps_that_were_made():
    gait = _gait_of(_bouts(walker()))
    assert gait is not None
    frame = 1 / FPS
    for side, first in (("left", 0.0), ("right", STEP_S)):
        phase = (np.array(gait.contacts_s[side]) - first) / STRIDE_S
        assert np.abs(phase - np.round(phase)).max() * STRIDE_S < frame
        phase = (np.array(gait.offs_s[side]) - first) / STRIDE_S - (1 - SWING)
        assert np.abs(phase - np.round(phase)).max() * STRIDE_S < frame
        stride_time, stance = gait.stride_time_s(side), gait.stance(side)
        assert stride_time is not None and stance is not None and stride_time.count >= 3
        assert stride_time.mean == pytest.approx(STRIDE_S, abs=0.01)
        assert stride_time.deviation == pytest.approx(0, abs=0.02)
        assert stance.mean == pytest.approx(1 - SWING, abs=0.03)
        both = gait.double_support(side)
        assert both is not None and both.mean == pytest.approx(1 - 2 * SWING, abs=0.06)
        length = gait.stride_length_m(side)
        assert length is not None and length.mean == pytest.approx(STRIDE_M, abs=1e-6)
    for side, expected_m in (("left", LEFT_M), ("right", RIGHT_M)):
        step = gait.step_length_m(side)
        assert step is not None and step.mean == pytest.approx(expected_m, abs=1e-6)
    width = gait.step_width_m()
    assert width is not None and width.mean == pytest.approx(WIDTH_M, abs=1e-6)
    assert gait.cadence_per_min == pytest.approx(60 / STEP_S, rel=0.01)
    assert gait.speed_m_s == pytest.approx(STRIDE_M / STRIDE_S, rel=0.01)


def test_noise_of_15_mm_that_was_filtered_moves_events_by_less_than_a_frame():
    exact = walker()
    rng, found = np.random.default_rng(4), []
    for _ in range(5):
        # About what a low-pass at 7 Hz leaves of it: the mean of two frames.
        noisy = {}
        for name in ("pelvis_m", "heels_m", "toes_m"):
            noise = rng.normal(0, 0.015, (len(exact.time_s) + 1, *getattr(exact, name).shape[1:]))
            noisy[name] = getattr(exact, name) + (noise[1:] + noise[:-1]) / 2
        gait = _gait_of(_bouts(replace(exact, **noisy)))
        assert gait is not None
        found += [(time, 0.0) for time in gait.contacts_s["left"]]
        found += [(time, STEP_S) for time in gait.contacts_s["right"]]
        step = gait.step_length_m("left")
        assert step is not None and step.mean == pytest.approx(LEFT_M, abs=0.02)
    phase = np.array([(time - first) / STRIDE_S for time, first in found])
    assert np.std(phase - np.round(phase)) * STRIDE_S < 1 / FPS


def still(points: WalkerPoints) -> WalkerPoints:
    """The same on a treadmill, whose belt takes back what the pelvis advances."""
    back = points.pelvis_m - points.pelvis_m[0]
    feet = {name: getattr(points, name) - back[:, None] for name in ("heels_m", "toes_m")}
    return replace(points, pelvis_m=points.pelvis_m - back, **feet)


def jumping(points: WalkerPoints) -> WalkerPoints:
    """Jumps ahead with both feet at once."""
    pair = {name: getattr(points, name)[:, [0, 0]] for name in ("heels_m", "toes_m")}
    return replace(points, **pair)


@pytest.mark.parametrize(
    "points",
    [
        walker(reach=0.15),  # marches on the spot
        walker(pace=2.4),  # as fast as people run
        walker(facing_deg=80.0),  # sideways
        walker(facing_deg=180.0),  # backwards
        walker(seconds=1.2),  # too short
        still(walker()),
        jumping(walker()),
    ],
    ids=["on the spot", "fast", "sideways", "backwards", "short", "treadmill", "jumps"],
)
def test_nobody_else_walks(points):
    assert _gait_of(_bouts(points)) is None


def test_of_somebody_who_stops_the_walking_is_told():
    exact = walker(8.0)
    held = np.minimum(np.arange(len(exact.time_s)), int(5 * FPS))  # stands still after 5 s
    stopped = {name: getattr(exact, name)[held] for name in ("pelvis_m", "heels_m", "toes_m")}
    gait = _gait_of(_bouts(replace(exact, **stopped)))
    assert gait is not None
    assert max(max(times) for times in gait.contacts_s.values()) < 5
    assert gait.cadence_per_min == pytest.approx(60 / STEP_S, rel=0.03)


def test_one_who_waves_and_nobody_have_no_gait():
    motion = waving(40)
    assert find_gait(motion) is None
    assert find_gait(motion.select(slice(0, 0))) is None


def test_heels_are_behind_toes_and_below_ankles():
    motion = waving(3)
    points = walker_points(motion)
    _, origin = motion.parts()
    for side, name in enumerate(SIDES):
        ankle = origin[:, motion.model.names.index(f"{name}_foot")]
        heel, toe = points.heels_m[:, side], points.toes_m[:, side]
        foot = np.linalg.norm(toe - heel, axis=1)
        assert np.all((foot > 0.12) & (foot < 0.25))
        assert np.all(np.linalg.norm(heel - ankle, axis=1) < 0.12)
    right, ahead = points.toes_m[:, 1], points.ahead  # the straight leg
    assert np.all(np.einsum("ti,ti->t", (right - points.heels_m[:, 1])[:, :2], ahead) > 0.1)


def test_cycles_go_from_contact_to_contact():
    time_s = np.arange(0, 5, 0.1)
    strides = [Stride("left", at, at + 0.6, at + 1, 1.2, 0.2) for at in (1.0, 2.5)]
    cycles = normalised_cycles(time_s**2, time_s, strides)
    assert cycles.shape == (2, 101)
    assert cycles[:, [0, 50, 100]] == pytest.approx(np.array([[1, 2.25, 4], [6.25, 9, 12.25]]))


def test_one_value_has_no_deviation():
    assert Spread.from_values([]) is None
    assert Spread.from_values([2.0]) == Spread(2.0, None, 1)
    assert Spread.from_values([1.0, 3.0]) == Spread(2.0, pytest.approx(2**0.5), 2)
