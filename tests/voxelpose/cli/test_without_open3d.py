"""Where open3d has no wheel, only its window and distances from scans are missing."""

import sys

import pytest

from tests.sources import ring, write_recording
from tests.test_structure import PACKAGES, ROOT
from voxelpose.cli import run
from voxelpose.machine_checks import _open3d


@pytest.fixture(autouse=True)
def without_open3d(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    monkeypatch.setenv("DISPLAY", ":0")


def test_results_are_made_reported_and_exported_without_it(desk):
    write_recording(desk / "walk", ring(2))
    assert run(["fit", "walk", "--out", "fitted", "--estimator", "standing"]) == 0
    assert run(["report", "fitted"]) == 0
    assert run(["export", "fitted", "--to", "bvh,csv,npz"]) == 0
    assert (desk / "fitted" / "report.html").stat().st_size > 10_000


def test_it_is_imported_at_one_place():
    importing = [
        path.name
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if "import open3d\n" in path.read_text(encoding="utf-8")
    ]
    assert importing == ["open3d_import.py"]


@pytest.mark.parametrize("words", ["view walk --open3d", "evaluate out --scan body.ply"])
def test_what_needs_it_is_refused_with_the_remedy(desk, capsys, words):
    assert run(words.split()) == 2
    assert "pip install 'voxelpose[open3d]'" in capsys.readouterr().err


def test_the_doctor_says_what_it_costs():
    level, found, remedy = _open3d()
    assert level == "look" and "open3d is not installed" in found
    assert remedy.startswith("only `view --open3d` and `evaluate --scan` need it: pip install")
