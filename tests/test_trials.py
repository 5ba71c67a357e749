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


def test_kinds_of_motion_are_named_by_their_clips(trials, tmp_path):
    for clip, kind in (("train_jumping_1", "jumping"), ("005_10", "005")):
        (tmp_path / "scene.json").write_text(f'{{"clip": "{clip}"}}')
        assert trials._motion_of(tmp_path) == kind
