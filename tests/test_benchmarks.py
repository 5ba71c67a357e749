import json
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
    recording = accuracy.open_row("made:alone")
    assert recording.folder == tmp_path / "out" / "made" / "alone"
    assert recording.rig.names == ("cam_3",)


def test_checked_outlines_become_masks(benchmarks, tmp_path):
    from benchmarks.checked_masks import read_checked

    square = [[[2, 2], [17, 2], [17, 17], [2, 17]]]
    hole, other = [[[6, 6], [9, 6], [9, 9], [6, 9]]], [[[20, 0], [23, 0], [23, 9], [20, 9]]]
    entry = {
        "person": square,
        "person_2": other,
        "holes": hole,
        "unknown": [[[0, 0], [1, 0], [0, 1]]],
    }
    path = tmp_path / "garden.json"
    path.write_text(json.dumps({"cameras": {"cam_1": {"7": entry}}}))
    frame = read_checked(path)["cam_1"][7]
    man, other_man = frame.masks_of_people((24, 20), (24, 20))
    assert man.shape == (20, 24) and man.sum() == 16 * 16 - 16 and not man[7, 7] and man[2, 17]
    assert other_man.sum() == 40 and frame.unknown_mask((24, 20), (24, 20)).sum() == 3
    half = frame.masks_of_people((24, 20), (12, 10))[0]
    assert half.sum() == 8 * 8 - 4 and not half[3, 3]
    assert read_checked(tmp_path / "none.json") == {}


def test_every_checked_outline_lies_within_a_picture(benchmarks):
    from benchmarks.checked_masks import FOOTAGE, read_checked

    files = sorted(FOOTAGE.glob("*.json"))
    assert len(files) == 6
    for path in files:
        assert path.stat().st_size < 60_000
        for frames in read_checked(path).values():
            for frame in frames.values():
                people = frame.masks_of_people((1920, 1920), (1920, 1920))
                assert all(mask.sum() > 1000 for mask in people), path.name


def test_footage_without_shared_recordings_is_skipped(benchmarks, monkeypatch, tmp_path, capsys):
    from benchmarks import footage

    monkeypatch.setattr(footage, "SHARED", tmp_path)
    assert footage.main([]) == 0
    assert "skipped: no footage" in capsys.readouterr().err
