"""Files of fitted weights: what they state, and that they are what is used."""

import shutil
import tomllib
from datetime import UTC, date, datetime

import numpy as np
import pytest

from benchmarks.weights_file import write_weights
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.monocular.tracking import joint_error
from voxelpose.multiview.quality import quality

FILES = {joint_error.FILE: 19 + 1 + 19, quality.FILE: 24 + 24 + 8}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_table_states_how_it_was_made(file):
    tables = tomllib.loads(file.read_text())
    assert sum(len(table["weights"]) for table in tables.values()) == FILES[file]
    for table in tables.values():
        assert table["command"].startswith(f"python -m benchmarks.{file.stem} ")
        assert "--fit" in table["command"] and "recordings" in table["data"]
        assert date.fromisoformat(table["date"]) and table["seed"]


def test_what_is_said_follows_the_file(tmp_path, monkeypatch):
    """One number less in the file: errors are e times smaller, and 3 mm are taken off again."""
    other = tmp_path / "other.toml"
    shutil.copy(joint_error.FILE, other)
    evidence = np.full((1, 15), 0.03), np.array([0.9]), np.zeros((1, 15), bool)
    before = joint_error.joint_errors(*evidence)
    world = fitted_weights(other)["world"] - np.repeat([1, 0], [15, 4])
    write_weights(other, {"world": world}, "seeds 1 to 3", "a command")
    fitted_weights.cache_clear()
    monkeypatch.setattr(joint_error, "FILE", other)
    after = joint_error.joint_errors(*evidence)
    np.testing.assert_allclose(after.joint_mm + 3, (before.joint_mm + 3) / np.e)
    np.testing.assert_array_equal(after.pose_mm, before.pose_mm)


def test_writing_states_how_and_keeps_other_tables(tmp_path):
    file = tmp_path / "weights.toml"
    shutil.copy(quality.FILE, file)
    write_weights(file, {"right": np.array([1.23456, -2.0])}, "seeds 1 to 3", "a command --fit")
    before, after = (tomllib.loads(path.read_text()) for path in (quality.FILE, file))
    made = after.pop("right")
    assert made["weights"] == [1.235, -2.0] and made["data"] == "seeds 1 to 3"
    assert made["command"] == "a command --fit"
    assert made["date"] == datetime.now(UTC).date().isoformat()
    assert after == {name: table for name, table in before.items() if name != "right"}
