"""The example bodies move within their limits, and are filmed with their truth."""

import numpy as np
import pytest

from examples.bodies.example_motions import (
    BODY,
    EXAMPLES,
    TRUE_MOTION,
    example_motion,
    film_example,
)
from silhouette_core.motion.motion_file import body_of_motion, read_motion
from voxelpose.demo.room import demo_rig
from voxelpose.recording.folder import Recording


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_move_inside_limits_and_pictures(name):
    motion = example_motion(name)
    low, high = motion.model.tree.dof_limits_rad.T
    assert (motion.angles_rad >= low).all() and (motion.angles_rad <= high).all()
    moving = np.ptp(motion.angles_rad, axis=0) > np.radians(5)
    assert moving.sum() >= 4
    still = bool((np.ptp(motion.root_m, axis=0) < 1e-9).all())
    assert still or not motion.model.tree.root_fixed
    assert motion.landmarks()[..., 2].min() > -0.05
    for camera in demo_rig(4):
        pixels, depth = camera.project(motion.landmarks().reshape(-1, 3))
        assert (depth > 1).all() and (pixels > 0).all() and (pixels < camera.size).all()


def test_a_filmed_example_holds_body_and_truth(tmp_path):
    folder = film_example(tmp_path / "arm", "robot_arm", 2, cameras=(1, 3))
    recording, truth = Recording.open(folder), read_motion(folder / TRUE_MOTION)
    assert recording.rig.names == ("cam_1", "cam_3") and recording.frame_count == len(truth) == 2
    assert body_of_motion(folder / BODY).names == truth.model.names
    np.testing.assert_array_equal(truth.angles_rad, example_motion("robot_arm", 2).angles_rad)


def test_an_unknown_example_is_refused():
    with pytest.raises(ValueError, match="no example 'horse'"):
        example_motion("horse")
