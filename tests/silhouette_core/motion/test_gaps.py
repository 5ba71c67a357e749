"""Frames without a pose between others: which are filled, and with what."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from silhouette_core.motion.conditioning import frames_in_gaps, gap_limit_frames, poses_between


@pytest.mark.parametrize(
    ("limit", "frames"),
    [(12, 12), ("12", 12), ("0", 0), ("0.1s", 3), ("0.1 s", 3), ("1s", 30), (".05s", 1)],
)
def test_limits_in_frames_and_in_seconds(limit, frames):
    assert gap_limit_frames(limit, 30.0) == frames


@pytest.mark.parametrize("limit", ["", "-1", "1.5", "2 m", "s", "1e9s", "nan", "9" * 20])
def test_limits_that_are_none(limit):
    with pytest.raises(InputError, match=r"as in 12, or seconds, as in 0\.2s"):
        gap_limit_frames(limit, 30.0)


def test_gaps_up_to_the_limit_are_filled_and_none_at_the_ends():
    frames = np.array([5, 6, 8, 12, 13])  # gaps of one and three
    np.testing.assert_array_equal(frames_in_gaps(frames, 1), [7])
    np.testing.assert_array_equal(frames_in_gaps(frames, 2), [7])
    np.testing.assert_array_equal(frames_in_gaps(frames, 3), [7, 9, 10, 11])
    assert len(frames_in_gaps(frames, 0)) == 0
    assert len(frames_in_gaps(frames[:1], 5)) == len(frames_in_gaps(frames[:0], 5)) == 0


def turning(frames: np.ndarray, rate: float) -> list[np.ndarray]:
    """A body that turns evenly about an oblique axis and moves along a parabola."""
    axis = np.array([0.6, 0.0, 0.8])
    turns = Rotation.from_rotvec(rate * frames[:, None] * axis).as_quat(scalar_first=True)
    turns *= np.where(np.arange(len(frames)) % 2, -1.0, 1.0)[:, None]  # both signs are one
    place = np.column_stack([frames, frames**2, np.zeros(len(frames))]) / 100.0
    return [place, turns, np.column_stack([frames / 10.0, np.ones(len(frames))])]


@pytest.mark.parametrize("method", ["linear", "pchip"])
def test_an_even_turn_is_filled_as_it_was(method):
    frames = np.arange(30)
    known, wanted = np.r_[0:12, 18:30], np.arange(12, 18)
    everything = turning(frames, 0.15)
    found = poses_between(known, [array[known] for array in everything], wanted, method)
    np.testing.assert_allclose(found[0][:, 0], everything[0][wanted, 0], atol=1e-9)
    np.testing.assert_allclose(found[2], everything[2][wanted], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found[1], axis=1), 1)
    first, second = (
        Rotation.from_quat(four, scalar_first=True) for four in (found[1], everything[1][wanted])
    )
    off = np.degrees((first.inv() * second).magnitude()).max()
    assert off < (1e-6 if method == "linear" else 1.5)


def test_the_cubic_keeps_the_speed_at_the_ends():
    """Along a parabola it is nearer to the truth than the chord."""
    known, wanted = np.r_[0:12, 18:30], np.arange(12, 18)
    truth = turning(np.arange(30), 0.1)
    off = {}
    for method in ("linear", "pchip"):
        found = poses_between(known, [array[known] for array in truth], wanted, method)
        off[method] = np.abs(found[0][:, 1] - truth[0][wanted, 1]).max()
    assert off["pchip"] < 0.5 * off["linear"]
