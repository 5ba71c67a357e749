import re
from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def benchmarks(beside):
    return beside("__main__")


def test_a_case_is_one_line_with_both_times_and_their_ratio(benchmarks, capsys):
    assert benchmarks.main(["a window"]) == 0
    _, line = capsys.readouterr().out.splitlines()
    match = re.match(
        r"carve a window, 100\^3 x 4 views +([\d.]+) ms +([\d.]+) ms   ratio +([\d.]+) x", line
    )
    assert match
    ours, reference, ratio = map(float, match.groups())
    assert ratio == pytest.approx(reference / ours, rel=0.1)


def test_an_unknown_case_is_named(benchmarks, capsys):
    assert benchmarks.main(["no such"]) == 2
    assert "there are: carve 128^3 x 8 views" in capsys.readouterr().err


def test_accuracy_without_shared_recordings_has_the_made_ones(
    benchmarks, monkeypatch, tmp_path, capsys
):
    from benchmarks import accuracy

    monkeypatch.setattr(accuracy, "SHARED", tmp_path)
    assert accuracy.all_rows() == accuracy.MADE_ROWS
    assert "made:short_heavy_walk" in accuracy.MADE_ROWS
    assert accuracy.main(["walk4", "made:nobody"]) == 2
    assert "no recording of walk4, made:nobody; there are made:" in capsys.readouterr().err
    (tmp_path / "data").mkdir()
    assert accuracy.all_rows() == (*accuracy.SHARED_ROWS, *accuracy.MADE_ROWS)


def test_a_made_row_is_rendered_once_and_opened(benchmarks, monkeypatch, tmp_path):
    from benchmarks import accuracy

    recipe = replace(accuracy.RECIPES["slim_swing_alone"], frames=2)
    monkeypatch.setattr(accuracy, "ROOT", tmp_path)
    monkeypatch.setattr(accuracy, "RECIPES", {"alone": recipe})
    recording, options = accuracy.open_row("made:alone")
    assert recording.folder == tmp_path / "out" / "made" / "alone"
    assert recording.rig.names == ("cam_3",) and options == {}
