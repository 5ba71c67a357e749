"""voxelpose demo: what it leaves. The fit itself is tested elsewhere; here somebody stands about
instead.
"""

import json

import pytest

from silhouette_core.estimator import load_estimator
from voxelpose import fitting
from voxelpose.cli import run


@pytest.fixture(autouse=True)
def somebody_stands_about(monkeypatch):
    monkeypatch.setattr(fitting, "load_estimator", lambda name: load_estimator("standing"))


def test_a_folder_worth_looking_at(desk, capsys):
    assert run(["demo", "--out", "demo", "--frames", "3", "--no-track"]) == 0
    assert sorted(path.name for path in (desk / "demo").iterdir()) == [
        "recording",
        "result",
        "score.json",
        "summary.json",
    ]
    assert (desk / "demo" / "result" / "contact_sheet.png").exists()
    assert json.loads((desk / "demo" / "score.json").read_text())["frames"] == 3
    out = capsys.readouterr().out
    assert "root_mm" in out and "voxelpose fit" in out
    assert run(["demo", "--out", "demo", "--frames", "3", "--no-track"]) == 2
    assert "demo exists" in capsys.readouterr().err
    assert run(["demo", "--out", "demo", "--frames", "2", "--overwrite", "--no-track"]) == 0
    assert json.loads((desk / "demo" / "score.json").read_text())["frames"] == 2


def test_impossible_length(desk, capsys):
    assert run(["demo", "--out", "demo", "--frames", "0"]) == 2
    assert not (desk / "demo").exists()
