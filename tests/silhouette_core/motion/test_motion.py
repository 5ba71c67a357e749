"""Motion checks what it is given."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calib.upright import Z_UP, UprightFrame
from silhouette_core.motion.floor import floor_height
from silhouette_core.motion.motion import Motion
from tests.clips import waving

_TREE = SimpleNamespace(dof_part=np.zeros(4, int), landmark_part=np.zeros(15, int))
MODEL = SimpleNamespace(tree=_TREE)


def motion(count: int = 5, **changes) -> Motion:
    arrays = {
        "root_m": np.zeros((count, 3)),
        "root_quaternion": np.tile([1.0, 0, 0, 0], (count, 1)),
        "angles_rad": np.zeros((count, 4)),
    }
    return Motion(30.0, MODEL, **{**arrays, **changes})  # type: ignore[arg-type]


def test_frames_and_times_follow_from_the_rate():
    clip = motion()
    assert clip.frames.tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(clip.time_s, np.arange(5) / 30)


def test_selecting_rows_keeps_everything_in_step():
    clip = motion(quality={"unexplained": np.arange(5) / 10})
    part = clip.select(slice(1, 4))
    assert len(part) == 3
    assert part.frames.tolist() == [1, 2, 3]
    np.testing.assert_array_equal(part.quality["unexplained"], [0.1, 0.2, 0.3])


def test_landmark_confidence_takes_the_best_that_there_is():
    assert motion().landmark_confidence().shape == (5, 15)
    overlap = motion(quality={"part_overlap": np.full((5, 27), 0.25)})
    np.testing.assert_array_equal(overlap.landmark_confidence(), 0.25)
    own = motion(
        quality={
            "part_overlap": np.full((5, 27), 0.25),
            "landmark_confidence": np.full((5, 15), 0.75),
        }
    )
    np.testing.assert_array_equal(own.landmark_confidence(), 0.75)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"angles_rad": np.zeros((5, 3))}, r"angles_rad must be \(5, 4\), got \(5, 3\)"),
        ({"root_m": np.full((5, 3), np.nan)}, r"root_m must be \(5, 3\) finite, got NaN"),
        ({"frames": np.array([0, 1, 1, 2, 3])}, "frames must increase"),
        (
            {"quality": {"unexplained": np.zeros(4)}},
            "quality 'unexplained' must have 5 rows, got 4",
        ),
    ],
)
def test_wrong_arrays_are_named(changes, words):
    with pytest.raises(ValueError, match=words):
        motion(**changes)


@pytest.mark.parametrize("up", [(0, 0, -1.0), (0, 1.0, 0), (0.6, 0, 0.8)])
def test_a_motion_goes_into_another_world_and_comes_back(up):
    clip, frame = waving(4), UprightFrame.from_up(up, -0.3)
    elsewhere = clip.in_world(frame)
    np.testing.assert_allclose(elsewhere.up, np.array(up), atol=1e-12)
    assert elsewhere.floor_m == -0.3
    joints = clip.landmarks()
    np.testing.assert_allclose(frame.points(elsewhere.landmarks()), joints, atol=1e-12)
    back = elsewhere.upright()
    np.testing.assert_allclose(back.landmarks(), joints, atol=1e-12)
    np.testing.assert_array_equal(back.up, Z_UP)
    assert back.floor_m == 0
    assert clip.upright() is clip


def test_the_floor_is_under_the_feet():
    clip = waving(4)
    assert floor_height(clip) == 0.0
    raised = replace(clip, root_m=clip.root_m + np.array([0, 0, 0.75]))
    assert floor_height(raised) == pytest.approx(0.75, abs=0.05)
    assert floor_height(raised, clip) == 0.0  # several stand on one floor
    # Feet are found less well than the world is measured.
    low = replace(clip, root_m=clip.root_m - np.array([0, 0, 0.07]))
    assert floor_height(low) == 0.0
