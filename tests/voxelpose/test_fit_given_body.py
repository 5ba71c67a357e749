"""`voxelpose fit --body` with bodies that are no person's, from frames to a result folder."""

import json

import numpy as np
import pytest

from examples.bodies.example_motions import BODY, TRUE_MOTION, film_example
from silhouette_core.motion.motion_file import read_motion
from voxelpose.cli import run
from voxelpose.results import Result


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "body", "most_deg", "most_mm"),
    [("robot_arm", "robot_arm.urdf", 2.0, 10.0), ("quadruped", BODY, 6.0, 20.0)],
)
def test_a_body_of_another_kind_is_fitted_by_the_command(name, body, most_deg, most_mm, desk):
    film_example(desk / name, name, 4)
    words = ["fit", name, "--out", "out", "--body", f"{name}/{body}"]
    assert run(words) == 0
    result, truth = Result.open(desk / "out"), read_motion(desk / name / TRUE_MOTION)
    motion = result.motion
    assert len(motion) == 4 and motion.model.names == truth.model.names
    turns = np.degrees(np.abs(motion.angles_rad - truth.angles_rad))
    assert turns.mean() < most_deg
    mm = 1000 * np.linalg.norm(motion.landmarks() - truth.landmarks(), axis=2)
    assert mm.mean() < most_mm
    if truth.model.tree.root_fixed:
        np.testing.assert_allclose(motion.root_m, motion.root_m[:1].repeat(4, 0), atol=1e-3)
    summary = json.loads((desk / "out" / "summary.json").read_text())
    assert summary["body"]["parts"] == len(truth.model.names)
    assert "joint_error_mm" not in summary["quality"] and summary["verdict"]["level"] == "reliable"
    assert run(["report", "out"]) == 0 and run(["export", "out", "--out", "exported"]) == 0
