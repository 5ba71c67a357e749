"""Tables of random recordings."""

import pytest


@pytest.fixture
def trials(beside):
    return beside("trials")


def trial(trials, root_mm, lost=0.0, status="done", right=0.9):
    from voxelpose.batch.jobs import Job
    from voxelpose.batch.run import Outcome

    summary = {
        "frames": {"lost": [], "with_pose": 10},
        "quality": {"right_probability": {"lower_quarter": right}},
    }
    score = {"root_mm": root_mm, "lost": lost, "joint_root_mm": [root_mm] * 15}
    job = Job("a", "a", "fit", {})
    return trials.Trial(Outcome(job, status, "", 1.0, summary, score), "walking")


def test_wrong_and_lost_ones_are_counted_and_so_are_doubts(trials):
    group = [trial(trials, float(k)) for k in range(10, 29)]
    group += [
        trial(trials, 300.0, right=0.1),
        trial(trials, 30.0, lost=0.9),
        trial(trials, 20.0, right=0.2),
    ]
    *_, row = trials.accuracy_table({"careless": group}).splitlines()
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells == ["careless", "22", "20.0", "300.0", "–", "20", "1 of 2", "1 of 20"]


def test_a_section_is_replaced_and_nothing_else(trials, monkeypatch, tmp_path):
    page = tmp_path / "several-cameras.md"
    monkeypatch.setattr(trials, "RESULTS", page)
    page.write_text("a\n<!-- trials all -->\n\nold\n\n<!-- end of trials all -->\nb\n")
    trials.write_section("all", "new")
    assert page.read_text() == "a\n<!-- trials all -->\n\nnew\n\n<!-- end of trials all -->\nb\n"
    page.write_text("a\n<!-- trials all -->\nb\n")
    with pytest.raises(SystemExit, match="has no place"):
        trials.write_section("all", "new")
    assert page.read_text() == "a\n<!-- trials all -->\nb\n"


def test_the_log_has_a_place_for_the_tables(trials):
    assert trials.RESULTS.read_text(encoding="utf-8").count("trials all -->") == 2


def test_kinds_of_motion_are_named_by_their_clips(trials, tmp_path):
    for clip, kind in (("train_jumping_1", "jumping"), ("005_10", "005")):
        (tmp_path / "scene.json").write_text(f'{{"clip": "{clip}"}}')
        assert trials._motion_of(tmp_path) == kind
