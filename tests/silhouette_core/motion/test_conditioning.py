"""Gaps filled and filters over a whole motion, undone and stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from calib.errors import InputError
from calib.upright import UprightFrame
from silhouette_core.motion.conditioning import (
    Conditioning,
    conditioned,
    conditioning_words,
    describe_conditioning,
    filter_warning,
)
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.clips import waving

NO_FILTER = Conditioning("none")
POSES = "root_m", "root_quaternion", "angles_rad"


def jittering(count: int = 60, fps: float = 50.0) -> Motion:
    """A motion with noise of single frames."""
    motion, rng = waving(count, fps=fps), np.random.default_rng(0)
    return replace(
        motion,
        root_m=motion.root_m + rng.normal(0, 0.01, motion.root_m.shape),
        angles_rad=motion.angles_rad + rng.normal(0, 0.02, motion.angles_rad.shape),
    )


def with_gaps(motion: Motion) -> Motion:
    """Without frames 20 to 22 and 40 to 47."""
    return motion.select(np.r_[0:20, 23:40, 48:60])


def test_the_usual_conditioning_is_the_filter_of_before():
    """Butterworth's of order 2 at 7 Hz forward and backward, in each run, and nothing filled."""
    given = with_gaps(jittering())
    found = conditioned(given, Conditioning())
    sections = butter(2, 7.0, fs=50.0, output="sos")
    for name in ("root_m", "angles_rad"):
        old, new = getattr(given, name), getattr(found, name)
        for rows in (slice(0, 20), slice(20, 37)):
            np.testing.assert_array_equal(new[rows], sosfiltfilt(sections, old[rows], axis=0))
        np.testing.assert_array_equal(new[37:], old[37:])  # twelve frames are too few
    np.testing.assert_array_equal(found.frames, given.frames)
    assert not found.filled.any()


def test_no_filter_and_no_gap_leave_the_poses():
    given = jittering()
    found = conditioned(given, NO_FILTER)
    for name in POSES:
        np.testing.assert_array_equal(getattr(found, name), getattr(given, name))
    assert found.unfiltered is None
    assert conditioning_words(found) == "no filter"


@pytest.mark.parametrize("method", ["linear", "pchip"])
def test_gaps_up_to_the_limit_are_filled_and_marked(method):
    clean = waving(60, fps=50.0)
    found = conditioned(with_gaps(clean), Conditioning("none", gap_limit=3, gap_method=method))
    np.testing.assert_array_equal(found.frames, np.r_[0:40, 48:60])
    np.testing.assert_array_equal(found.frames[found.filled], [20, 21, 22])
    np.testing.assert_allclose(found.time_s, found.frames / 50.0)
    np.testing.assert_allclose(found.landmarks()[20:23], clean.landmarks()[20:23], atol=1e-3)
    assert np.isnan(found.quality["unexplained"][20:23]).all()
    assert np.isfinite(found.quality["unexplained"][~found.filled]).all()
    assert (found.landmark_confidence()[20:23] == 0).all()
    assert (found.landmark_confidence()[~found.filled] > 0).all()
    said = describe_conditioning(found)
    assert (said["frames_left"], said["gap_limit_frames"]) == (8, 3)
    assert conditioning_words(found) == (
        f"no filter; 3 missing frames filled ({method}, gaps up to 3 frames); 8 missing frames left"
    )


def test_the_method_none_fills_nothing():
    found = conditioned(with_gaps(waving(60)), Conditioning(gap_limit=9, gap_method="none"))
    assert len(found) == 49 and not found.filled.any()


def test_a_filled_run_is_filtered_as_one():
    found = conditioned(with_gaps(jittering()), Conditioning(gap_limit="0.2s"))
    assert len(found) == 60 and not filter_warning(found)
    assert np.abs(np.diff(found.root_m, 2, axis=0)).max() < 0.02


@pytest.mark.parametrize("kind", ["butterworth", "savgol", "gaussian"])
def test_another_filter_begins_from_the_poses_as_they_were(kind):
    given = with_gaps(jittering())
    first = conditioned(given, Conditioning(gap_limit=5))
    other = Conditioning(kind, 4.0)
    direct, again = conditioned(given, other), conditioned(first, other)
    for name in (*POSES, "frames", "filled"):
        np.testing.assert_array_equal(getattr(again, name), getattr(direct, name))
    for name in given.quality:
        np.testing.assert_array_equal(again.quality[name], given.quality[name])
    plain = conditioned(first, NO_FILTER)
    np.testing.assert_array_equal(plain.root_m, given.root_m)


def test_another_filter_in_a_world_that_is_not_upright():
    """A filter commutes with turning and moving the world."""
    given, frame = with_gaps(jittering()), UprightFrame.from_up(np.array([0.0, -0.6, 0.8]), 0.3)
    turned = replace(conditioned(given, Conditioning()), floor_m=0.1).in_world(frame)
    again = conditioned(turned, Conditioning("gaussian", gap_limit=5)).upright()
    direct = conditioned(replace(given, floor_m=0.1), Conditioning("gaussian", gap_limit=5))
    np.testing.assert_allclose(again.landmarks(), direct.upright().landmarks(), atol=1e-9)
    assert turned.unfiltered.floor_m == turned.floor_m


@pytest.mark.parametrize(
    ("count", "fps", "line"),
    [
        (
            60,
            15.0,
            "15 frames per second are too few for a cut-off of 7 Hz (a cut-off of at most 6 ",
        ),
        (12, 50.0, "12 of 12 frames are not filtered: they are in runs shorter than the 16 frames"),
    ],
)
def test_where_the_filter_cannot_act_it_says_so(count, fps, line):
    motion = conditioned(waving(count, fps=fps), Conditioning())
    assert line in filter_warning(motion)
    assert line in conditioning_words(motion)
    assert describe_conditioning(motion)["frames_unfiltered"] == count
    np.testing.assert_array_equal(motion.angles_rad, waving(count, fps=fps).angles_rad)


def test_where_it_acts_it_says_how():
    motion = conditioned(waving(60, fps=50.0), Conditioning("savgol", 5.0))
    assert conditioning_words(motion) == "Savitzky-Golay low-pass, 5 Hz, polynomial of degree 3"
    assert describe_conditioning(motion)["window_frames"] % 2 == 1
    motion = conditioned(waving(60, fps=50.0), Conditioning("gaussian", 5.0))
    assert conditioning_words(motion) == "Gaussian low-pass, 5 Hz"
    motion = conditioned(waving(60, fps=50.0), Conditioning())
    assert conditioning_words(motion) == "Butterworth low-pass, 7 Hz, order 2, forward and backward"
    assert describe_conditioning(waving(60)) == {}
    assert conditioning_words(waving(60)) == "filter not recorded"


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"filter": "kalman"}, "no filter 'kalman'"),
        ({"cutoff_hz": 0.0}, "cut-off of 0 Hz"),
        ({"cutoff_hz": float("nan")}, "cut-off of nan Hz"),
        ({"filter_order": 0}, "order 0 is not from 1 to 8"),
        ({"filter": "gaussian", "filter_order": 2}, "has no order"),
        ({"gap_limit": "soon"}, "gap limit 'soon'"),
        ({"gap_method": "spline"}, "no gap method 'spline'"),
    ],
)
def test_values_that_are_none(given, line):
    with pytest.raises(InputError, match=line):
        Conditioning(**given)


def test_a_file_keeps_what_was_done_and_what_was_before(tmp_path):
    motion = conditioned(with_gaps(jittering()), Conditioning("savgol", 6.0, 2, "0.1s", "pchip"))
    write_motion(motion, tmp_path / "m.safetensors")
    found = read_motion(tmp_path / "m.safetensors")
    assert found.conditioning == motion.conditioning
    np.testing.assert_array_equal(found.filled, motion.filled)
    for name in (*POSES, "frames", "time_s"):
        np.testing.assert_array_equal(
            getattr(found.unfiltered, name), getattr(motion.unfiltered, name)
        )
    again = conditioned(found, NO_FILTER)
    np.testing.assert_array_equal(again.root_m, with_gaps(jittering()).root_m)


def test_rows_take_their_unfiltered_poses_along():
    motion = conditioned(with_gaps(jittering()), Conditioning(gap_limit=5))
    part = motion.select(np.arange(15, 30))
    np.testing.assert_array_equal(part.unfiltered.frames, part.frames[~part.filled])
