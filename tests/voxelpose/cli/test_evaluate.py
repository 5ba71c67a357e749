"""voxelpose evaluate, with the reviewers' own numbers beside it."""

import json

import numpy as np
import pytest

from examples.bodies.example_motions import example_motion
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.motion_file import write_motion
from tests.clips import waving
from tests.other_bodies import TURNED_DEG, write_example_result
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.export.tables import write_joints
from voxelpose.export.trc import write_trc


@pytest.fixture
def results(desk):
    """A joints.csv, one with a frame lost and the others moved by 5 cm, truth.json and a TRC."""
    motion = waving(8)
    joints = {name: motion.landmarks()[:, k].tolist() for k, name in enumerate(LANDMARK_NAMES)}
    (desk / "truth.json").write_text(
        json.dumps({"fps": 25, "unit": "m", "up": "z", "joints": joints})
    )
    write_trc(motion, desk / "truth.trc")
    for name, rows in (("one", np.arange(8)), ("two", np.array([0, 1, 2, 4, 5, 6, 7]))):
        (desk / name).mkdir()
        write_joints(motion.select(rows), desk / name / "joints.csv")
    text = (desk / "two" / "joints.csv").read_text().splitlines()
    moved = [
        ",".join(
            [*row.split(",")[:3], f"{float(row.split(',')[3]) + 0.05:.6f}", *row.split(",")[4:]]
        )
        for row in text[1:]
    ]
    (desk / "two" / "joints.csv").write_text("\n".join([text[0], *moved]))
    return desk


@pytest.mark.parametrize("truth", ["truth.json", "truth.trc"])
def test_json_of_one(results, capsys, truth):
    assert run(["evaluate", "two", "--truth", truth, "--json"]) == 0
    score = json.loads(capsys.readouterr().out)
    assert score["mpjpe_mm"] == pytest.approx(50, abs=0.01)
    assert (score["frames"], score["lost"]) == (8, 1 / 8)
    assert set(score["joint_root_mm"]) == set(LANDMARK_NAMES)


def test_the_truth_may_come_last(results, capsys):
    assert run(["evaluate", "one", "truth.json"]) == 0
    assert "0.0 mm" in capsys.readouterr().out


def test_what_the_truth_lacks_is_not_scored(results, capsys):
    document = json.loads((results / "truth.json").read_text())
    del document["joints"]["head_top"]
    document["joints"]["left_wrist"] = None
    document["joints"]["right_wrist"][5] = None
    document["joints"]["pelvis"][6] = [None] * 3
    for joint in document["joints"].values():
        if joint is not None:
            joint[7] = None
    (results / "truth.json").write_text(json.dumps(document))
    assert run(["evaluate", "two", "--truth", "truth.json", "--json"]) == 0
    score = json.loads(capsys.readouterr().out)
    assert (score["frames"], score["lost"], score["pck150"]) == (7, pytest.approx(1 / 7), 1)
    assert score["mpjpe_mm"] == pytest.approx(50, abs=0.01)
    assert max(score["root_mm"], score["pa_mm"], score["angle_deg"]) < 0.01
    assert score["jitter_mm"] == pytest.approx(score["jitter_truth_mm"], abs=0.01)
    unknown = [name for name, mm in score["joint_root_mm"].items() if mm is None]
    assert unknown == ["head_top", "left_wrist"]
    assert run(["evaluate", "two", "--truth", "truth.json"]) == 0
    assert "the truth lacks them: head_top, left_wrist" in capsys.readouterr().out


def test_table_of_several(results, capsys):
    assert run(["evaluate", "one", "two", "--truth", "truth.json", "truth.trc", "--markdown"]) == 0
    lines = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in capsys.readouterr().out.splitlines()
    ]
    assert [line[0] for line in lines] == ["recording", "---", "one", "two", "**mean**"]
    assert len({len(line) for line in lines}) == 1
    column = lines[0].index("mpjpe_mm")
    assert [line[column] for line in lines[2:]] == ["0.0", "50.0", "25.0"]
    assert [line[lines[0].index("lost")] for line in lines[2:]] == ["0.000", "0.125", "0.062"]
    assert [line[1] for line in lines[2:]] == ["8", "8", "16"]


def test_truth_of_the_recording_that_was_fitted(fitted, desk, capsys):
    assert run(["evaluate", "fitted"]) == 2
    assert "walk: give --truth" in capsys.readouterr().err
    rows = [
        line.split(",") for line in (desk / "fitted" / "joints.csv").read_text().splitlines()[1:]
    ]
    joints = {
        name: [[float(cell) for cell in row[3:6]] for row in rows if row[2] == name]
        for name in LANDMARK_NAMES
    }
    (desk / "walk" / "truth.json").write_text(json.dumps({"unit": "m", "joints": joints}))
    assert run(["evaluate", "fitted", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 5


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("one", "one does not say which recording it is of"),
        ("one two --truth truth.json truth.json truth.json", "2 results and 3 truths"),
        ("one --truth truth.trc --markers nose=Nose", "--markers nose=Nose is not understood"),
        ("one --truth truth.trc --markers neck=C7", "has no marker 'C7'"),
        ("one --truth truth.trc --axes up", "--axes up is not understood"),
        ("one --truth nothing.trc", "nothing.trc cannot be read"),
        ("", "no result is named"),
    ],
)
def test_mistakes(results, capsys, words, line):
    assert run(["evaluate", *words.split()]) == 2
    assert line in capsys.readouterr().err


@pytest.mark.parametrize("name", ["robot_arm", "quadruped"])
def test_any_body_is_scored_in_its_own_names(desk, capsys, name):
    truth, motion = write_example_result(desk, name, pictures=False)
    result, model = f"{name}_fit", truth.model
    assert run(["evaluate", result, "--json"]) == 0  # the recording's own truth
    score = json.loads(capsys.readouterr().out)
    assert (score["frames"], score["lost"]) == (4, 1 / 4)
    angles = score["each_joint_angle_deg"]
    assert list(angles) == list(model.tree.dof_names)
    assert angles[model.tree.dof_names[-1]] == pytest.approx(TURNED_DEG)
    assert score["joint_angle_deg"] == pytest.approx(TURNED_DEG / model.dof_count)
    apart = np.linalg.norm(motion.landmarks() - truth.landmarks()[1:], axis=2)
    assert score["mpjpe_mm"] == pytest.approx(1000 * apart.mean(), abs=2e-3)
    assert list(score["joint_root_mm"]) == list(model.tree.landmark_names)
    assert 0 < score["angle_deg"] < TURNED_DEG
    assert (score["flips"] is None) == (name == "robot_arm")
    assert run(["evaluate", result]) == 0
    printed = capsys.readouterr().out
    assert all(word in printed for word in (*model.tree.dof_names, *model.tree.landmark_names))
    assert run(["evaluate", result, "--markdown"]) == 0
    assert "joint_angle_deg" in capsys.readouterr().out
    # A joints.csv knows no angles.
    write_joints(truth, desk / "truth.csv")
    assert run(["evaluate", result, "--truth", "truth.csv", "--json"]) == 0
    other = json.loads(capsys.readouterr().out)
    assert other["mpjpe_mm"] == pytest.approx(score["mpjpe_mm"], abs=2e-3)
    assert other["joint_angle_deg"] is None and other["each_joint_angle_deg"] == {}
    # Compared two frames later, one frame is left.
    assert run(["evaluate", result, "--offset", "2", "--json"]) == 0
    late = json.loads(capsys.readouterr().out)
    assert late["lost"] == 3 / 4
    degrees = np.degrees(np.abs(motion.angles_rad[0] - truth.angles_rad[3]))
    assert list(late["each_joint_angle_deg"].values()) == pytest.approx(degrees.tolist())


def test_the_truth_of_another_body_is_refused(results, capsys):
    write_example_result(results, "robot_arm", 2, pictures=False)
    lamp = example_motion("desk_lamp", 2)
    write_motion(lamp, results / "lamp.safetensors")
    write_joints(lamp, results / "lamp.csv")
    for truth, joint in (
        ("truth.json", "pelvis"),
        ("truth.trc", "pelvis"),
        ("lamp.csv", "base"),
        ("lamp.safetensors", "base"),
    ):
        assert run(["evaluate", "robot_arm_fit", "--truth", truth]) == 2
        said = capsys.readouterr().err
        assert f"{truth} has the joint '{joint}'" in said and "world, turret" in said
        assert len(said.splitlines()) == 1
    # One name in common is not enough.
    text = (results / "lamp.csv").read_text().replace("base", "turret")
    (results / "lamp.csv").write_text(text)
    assert run(["evaluate", "robot_arm_fit", "--truth", "lamp.csv"]) == 2
    assert "has the joint 'lower_arm'" in capsys.readouterr().err
    # And a person's result is not scored against a robot.
    assert run(["evaluate", "one", "--truth", "robot_arm/truth.safetensors"]) == 2
    assert "has the joint 'world'" in capsys.readouterr().err


def test_a_persons_true_motion_gives_the_angles_too(desk, capsys):
    write_staged(desk / "walk", waving(5), ring(2))
    words = ["fit", "walk", "--out", "fitted", "--estimator", "standing", "--no-pictures"]
    assert run([*words, "--stature", "1.7"]) == 0
    write_motion(waving(5), desk / "walk" / "truth.safetensors")
    capsys.readouterr()
    assert run(["evaluate", "fitted", "--json"]) == 0
    score = json.loads(capsys.readouterr().out)
    assert "left_shin.flexion" in score["each_joint_angle_deg"]
    assert list(score["joint_root_mm"]) == list(LANDMARK_NAMES)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("frame,joint,x_m,y_m,z_m\n99999999,arm,0,0,0\n", "1 rows, the last frame being 99999999"),
        ("frame,joint,x_m,y_m,z_m\nfirst,arm,0,0,0\n", "line 2 cannot be read"),
        ("frame,joint,x_m,y_m,z_m\n", "no position of a joint"),
        ("frame,joint,x_m,y_m,z_m\n0,arm,nan,0,0\n", "no position of a joint"),
        (
            "frame,joint,x_m,y_m,z_m\n" + "".join(f"0,j{k},0,0,0\n" for k in range(1001)),
            "more than 1000 joints",
        ),
    ],
)
def test_a_damaged_table_of_the_truth_is_refused(results, capsys, text, line):
    (results / "truth.csv").write_text(text)
    assert run(["evaluate", "one", "--truth", "truth.csv"]) == 2
    said = capsys.readouterr().err
    assert line in said and len(said.splitlines()) == 1
