"""Steps of a build count only for the inputs they were made with; one process builds at a time."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.storage.atomic import claimed
from silhouette_core.monocular.making import from_motion
from silhouette_core.monocular.tree.build import Checkpoint
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from tests.clips import waving


def test_a_finished_step_is_not_made_again(tmp_path):
    Checkpoint(tmp_path / "steps", "inputs").step("a", lambda: {"x": np.arange(3)})
    arrays = Checkpoint(tmp_path / "steps", "inputs").step("a", lambda: pytest.fail("made again"))
    assert list(arrays) == ["x"] and arrays["x"].tolist() == [0, 1, 2]


def test_a_step_of_other_inputs_does_not_count(tmp_path):
    def step(checkpoint, value):
        return float(checkpoint.step("a", lambda: {"x": np.array([value])})["x"][0])

    ours = Checkpoint(tmp_path / "steps", "ours")
    assert step(Checkpoint(tmp_path / "steps", "theirs"), 1.0) == 1.0
    # The folder says theirs by now; each step says for itself.
    assert step(ours, 2.0) == step(ours, 3.0) == 2.0
    assert step(Checkpoint(tmp_path / "steps", "theirs"), 4.0) == 4.0


def test_two_processes_cannot_build_one_library(tmp_path, monkeypatch):
    motion, path = waving(4), tmp_path / "me.vplib"
    monkeypatch.setattr(from_motion, "build_library", lambda *_: pytest.fail("it began"))
    with claimed(path), pytest.raises(InputError, match=r"another process is writing .*me\.vplib"):
        from_motion.make_library({"wave": motion}, motion.model, path, LibrarySettings(poses=48))
