"""`voxelpose track --body` with bodies that are no person's, from frames to a result folder."""

import json

import numpy as np
import pytest

from examples.bodies.example_motions import BODY, TRUE_MOTION, film_example
from silhouette_core.monocular import body_library
from silhouette_core.motion.motion_file import read_motion
from voxelpose.cli import run
from voxelpose.export.tables import HYPOTHESES, read_hypotheses
from voxelpose.results import Result


@pytest.fixture
def small_libraries(monkeypatch):
    """Samples an eighth as many poses as the command does otherwise, and looks at half the frames
    for a root that stands still.
    """
    monkeypatch.setattr(body_library, "_MOMENTS", 4)
    for name in ("_SAMPLED_FRAMES", "_FROM_ALL_SIDES", "_FROM_ONE_SIDE"):
        monkeypatch.setattr(body_library, name, getattr(body_library, name) // 8)


@pytest.mark.slow
@pytest.mark.usefixtures("small_libraries")
@pytest.mark.parametrize(
    ("name", "camera", "most_deg", "most_mm"),
    [("robot_arm", 3, 6.0, 60.0), ("quadruped", 2, 14.0, 80.0)],
)
def test_a_body_of_another_kind_is_tracked_by_the_command(name, camera, most_deg, most_mm, desk):
    film_example(desk / name, name, 8, (camera,))
    words = ["track", name, "--camera", f"cam_{camera}", "--out", "out"]
    assert run([*words, "--body", f"{name}/{BODY}"]) == 0
    result, truth = Result.open(desk / "out"), read_motion(desk / name / TRUE_MOTION)
    motion, tree = result.motion, truth.model.tree
    assert len(motion) == 8 and motion.model.names == truth.model.names
    assert np.degrees(np.abs(motion.angles_rad - truth.angles_rad)).mean() < most_deg
    found, true = motion.landmarks(), truth.landmarks()
    relative = found - found[:, :1] - (true - true[:, :1])
    assert 1000 * np.linalg.norm(relative, axis=2).mean() < most_mm
    if tree.root_fixed:
        np.testing.assert_allclose(motion.root_m, motion.root_m[:1].repeat(8, 0), atol=1e-3)
    hypotheses = read_hypotheses(desk / "out" / HYPOTHESES, tree)
    assert hypotheses[0][0].joints_m.shape == (len(tree.landmark_names), 3)
    summary = json.loads((desk / "out" / "summary.json").read_text())
    assert summary["facts"]["library"]["file"] == "sampled"
    if tree.root_fixed:
        return
    assert run(["export", "out", "--out", "exported"]) == 0
    # The result is a motion of the body, of which a library can be made.
    build = ["library", "build", "out", "--out", "own.vplib", "--body", f"{name}/{BODY}"]
    assert run([*build, "--poses", "400", "--pitch", "20"]) == 0
    again = ["again", "--library", "own.vplib", "--no-smooth", "--no-pictures", "--frames", "0:3"]
    assert run([*words[:-1], *again]) == 0
