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


@pytest.mark.slow
def test_a_quadruped_is_tracked_by_the_command(desk, monkeypatch):
    # An eighth as many poses as the command samples otherwise.
    for name in ("_SAMPLED_FRAMES", "_FROM_ALL_SIDES", "_FROM_ONE_SIDE"):
        monkeypatch.setattr(body_library, name, getattr(body_library, name) // 8)
    film_example(desk / "quadruped", "quadruped", 8, (2,))
    words = ["track", "quadruped", "--camera", "cam_2", "--out", "out"]
    assert run([*words, "--body", f"quadruped/{BODY}"]) == 0
    result, truth = Result.open(desk / "out"), read_motion(desk / "quadruped" / TRUE_MOTION)
    motion, tree = result.motion, truth.model.tree
    assert len(motion) == 8 and motion.model.names == truth.model.names
    assert np.degrees(np.abs(motion.angles_rad - truth.angles_rad)).mean() < 14
    found, true = motion.landmarks(), truth.landmarks()
    relative = found - found[:, :1] - (true - true[:, :1])
    assert 1000 * np.linalg.norm(relative, axis=2).mean() < 80
    hypotheses = read_hypotheses(desk / "out" / HYPOTHESES, tree)
    assert hypotheses[0][0].joints_m.shape == (len(tree.landmark_names), 3)
    summary = json.loads((desk / "out" / "summary.json").read_text())
    assert summary["facts"]["library"]["file"] == "sampled"
    assert run(["export", "out", "--out", "exported"]) == 0
    # The result is a motion of the body, of which a library can be made.
    build = ["library", "build", "out", "--out", "own.vplib", "--body", f"quadruped/{BODY}"]
    assert run([*build, "--poses", "400", "--pitch", "20"]) == 0
    again = ["again", "--library", "own.vplib", "--no-smooth", "--no-pictures", "--frames", "0:3"]
    assert run([*words[:-1], *again]) == 0
