"""Steps between poses."""

import numpy as np

from silhouette_core.motion.pose import Pose, PoseArrays, steps_of


def test_steps_of_a_sequence_are_those_between_its_poses():
    rng = np.random.default_rng(0)
    poses = [Pose(rng.normal(size=3), np.eye(3), rng.normal(size=54))]
    for _ in range(4):
        poses.append(poses[-1].moved(0.3 * rng.standard_normal(60)))
    steps = steps_of(PoseArrays.from_poses(poses))
    assert steps.shape == (4, 60)
    for step, before, after in zip(steps, poses, poses[1:], strict=False):
        np.testing.assert_allclose(step, after.minus(before), atol=1e-12)
        np.testing.assert_allclose(before.moved(step).root_rotation, after.root_rotation)
