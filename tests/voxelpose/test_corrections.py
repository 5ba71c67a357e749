"""Corrections by hand: beside the estimate, in all that reads a result, and taken back."""

import json
import shlex
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import EXCHANGED_LANDMARKS, LANDMARK_NAMES
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.heading import limbs_exchanged, turned_half_round
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.motion_file import read_motion, write_motion
from tests.clips import walking, waving, waving_couple
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.corrections import (
    ExchangePeople,
    ExchangeSides,
    Trim,
    corrected_motions,
    write_corrections,
)
from voxelpose.reliability import findings_of, verdict_of
from voxelpose.results import Result, correct, open_people
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes


def test_half_a_turn_puts_every_joint_where_that_of_the_other_side_was():
    """As far as joints allow: a knee that would bend forward is straight."""
    motion = walking(8)
    rows = np.arange(8) >= 3
    turned = turned_half_round(motion, rows)
    before, after = (landmarks(each.model, *each.parts()) for each in (motion, turned))
    assert np.array_equal(after[:3], before[:3])
    far_m = np.linalg.norm(after[3:] - before[3:, EXCHANGED_LANDMARKS], axis=2)
    assert far_m.max() < 0.092 < np.linalg.norm(after[3:] - before[3:], axis=2).max()
    low, high = motion.model.tree.dof_limits_rad.T
    bent = turned_half_round(waving(8), rows)
    assert ((low <= bent.angles_rad[3:]) & (bent.angles_rad[3:] <= high)).all()
    assert np.isnan(turned.quality["joint_error_mm"][3:]).all()
    assert (bent.landmark_confidence()[3:] == 0).all()


@pytest.mark.parametrize(
    ("limbs", "ends", "most"), [("arms", "elbow wrist", 0.6), ("legs", "knee ankle", 0.3)]
)
def test_limbs_change_sides_while_the_trunk_stays(limbs, ends, most):
    """As far as joints allow: arms hang on their own shoulders."""
    motion = walking(8)
    angles, names = motion.angles_rad.copy(), motion.model.tree.dof_names
    for angle, degrees in (("forward", 60), ("abduction", -20)):  # both arms before the body
        for side in ("left", "right"):
            angles[:, names.index(f"{side}_upper_arm.{angle}")] = np.radians(degrees)
    motion = replace(motion, angles_rad=angles)
    found = limbs_exchanged(motion, np.arange(8) >= 3, limbs)
    before, after = motion.landmarks(), found.landmarks()
    moved = np.array([name.endswith(tuple(ends.split())) for name in LANDMARK_NAMES])
    assert np.array_equal(after[:3], before[:3])
    assert np.abs(after[:, ~moved] - before[:, ~moved]).max() < 0.01  # centres beside the joints
    wanted = before[3:, EXCHANGED_LANDMARKS]
    far_m, apart_m = (
        np.linalg.norm(wanted - one[3:], axis=2)[:, moved].mean() for one in (after, before)
    )
    assert far_m < most * apart_m
    words = f"left and right {limbs} exchanged in frames 3–7"
    assert str(ExchangeSides((3, 8), limbs=limbs)) == words


def test_what_was_wrong_is_not_filtered_into_what_was_right():
    """A half turn that the fit took is taken out: the filter then acts on what is smooth."""
    right = walking(60)
    wrong = conditioned(turned_half_round(right, np.arange(60) >= 30), Conditioning())
    made = [ExchangeSides((30, 60))]
    (found,) = corrected_motions([wrong], made, Path())
    error_m = np.linalg.norm(found.landmarks() - right.landmarks(), axis=2)
    assert error_m.max() < 0.09 and error_m[:30].max() < 0.02
    assert found.corrections == ("left and right exchanged in frames 30–59",)
    assert found.conditioning == wrong.conditioning


def test_people_exchange_their_poses_and_keep_their_bodies():
    motions = waving_couple(8)
    found = corrected_motions(motions, [ExchangePeople(4)], Path())
    for number, motion in enumerate(found):
        mine, other = motions[number], motions[1 - number]
        assert motion.model is mine.model
        early, late = motion.frames < 4, motion.frames >= 4
        assert np.array_equal(motion.root_m[early], mine.root_m[mine.frames < 4])
        wanted_m = other.landmarks()[other.frames >= 4].mean(axis=1)
        assert np.abs(motion.landmarks()[late].mean(axis=1) - wanted_m).max() < 1e-9
        assert np.array_equal(motion.angles_rad[late], other.angles_rad[other.frames >= 4])
    undone = corrected_motions(motions, [ExchangePeople(4), ExchangePeople(4)], Path())
    for motion, before in zip(undone, motions, strict=True):
        assert np.abs(motion.landmarks() - before.landmarks()).max() < 1e-9
    with pytest.raises(InputError, match="there is no person 3: this result has 2"):
        corrected_motions(motions, [ExchangePeople(4, (1, 3))], Path())


def test_a_result_is_corrected_wherever_it_is_read_and_the_estimate_stays(fitted, capsys):
    """Files of the fit do not change; taken back, nothing is left."""
    write_motion(replace(walking(20), frames=np.arange(20)), fitted / "motion.safetensors")
    files = {path: path.read_bytes() for path in fitted.iterdir()}
    before, count = Result.open(fitted), len(Result.open(fitted).motion)
    assert run(["correct", "fitted", "--trim", "1:", "--exchange-sides", ":4"]) == 0
    assert capsys.readouterr().out == (
        "1  trimmed to frames 1–19\n2  left and right exchanged in frames 0–3\n"
    )
    result = Result.open(fitted)
    assert len(result.motion) == count - 1 and result.motion.frames[0] == 1
    words = "corrected by hand: trimmed to frames 1–19, left and right exchanged in frames 0–3"
    finding = findings_of(result.summary)[0]
    assert (finding.about, finding.words) == ("Corrections", words)
    assert run(["export", "fitted", "--out", "files", "--to", "csv,glb,c3d,html"]) == 0
    for entry in json.loads((fitted.parent / "files" / "export.json").read_text())[
        "files"
    ].values():
        assert entry["corrections"] == list(result.motion.corrections)
    assert words.encode() in (fitted.parent / "files" / "motion.c3d").read_bytes()
    assert words.encode() in (fitted.parent / "files" / "motion.glb").read_bytes().replace(
        b"\\u2013", "–".encode()
    )
    page = (fitted.parent / "files" / "motion.html").read_text(encoding="utf-8")
    assert "trimmed to frames 1" in page
    assert {path: path.read_bytes() for path in files} == files
    assert run(["correct", "fitted", "--undo", "1"]) == 0
    assert Result.open(fitted).motion.corrections == ("left and right exchanged in frames 0–3",)
    assert run(["correct", "fitted", "--undo", "last"]) == 0
    assert capsys.readouterr().out.endswith("nothing is corrected\n")
    assert {path: path.read_bytes() for path in fitted.iterdir()} == files
    assert np.array_equal(Result.open(fitted).motion.root_m, before.motion.root_m)


def test_frames_that_nothing_measures_make_a_result_doubtful():
    summary = {"frames": {"with_pose": 100}, "quality": {"right_probability": {}}, "findings": []}
    assert verdict_of(summary).level == "reliable"
    made = {"words": ["left and right exchanged in frames 10–49"], "unmeasured": 2}
    assert verdict_of(summary | {"corrections": made}).level == "reliable"
    verdict = verdict_of(summary | {"corrections": made | {"unmeasured": 40}})
    assert verdict.level == "doubtful" and "look at these 40 frames" in verdict.reason


def test_several_people_have_their_corrections_in_common(couple, capsys):
    first = [result.motion for result in open_people(couple)]
    assert run(["correct", "couple", "--exchange-people", "1,2", "--start", "3"]) == 0
    assert run(["correct", "couple/person_2", "--exchange-sides", "3"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "1  persons 1 and 2 exchanged from frame 3 on",
        "2  left and right of person 2 exchanged in frame 3",
    ]
    one = Result.open(couple / "person_1").motion
    assert np.array_equal(one.angles_rad[3:], first[1].angles_rad[first[1].frames >= 3])
    assert len(one.corrections) == 2  # whose poses are partly those of the other
    assert [len(each.motion.corrections) for each in open_people(couple)] == [2, 2]
    assert not (couple / "person_2" / "corrections.json").exists()
    assert run(["correct", "couple", "--exchange-sides", "3"]) == 2
    assert "--person" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--trim", "900:"], "left without a pose"),
        (["--exchange-sides", "700:800"], "there is no pose in"),
        (["--exchange-people", "1,2"], "--start"),
        (["--exchange-people", "1,2", "--start", "1"], "there is no person 2"),
        (["--undo", "3"], "--undo 3 names no correction: nothing is corrected"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_is_written(fitted, capsys, words, line):
    assert run(["correct", "fitted", *words]) == 2
    assert line in capsys.readouterr().err
    assert not (fitted / "corrections.json").exists()


def test_a_damaged_file_is_refused_and_all_can_be_taken_back(fitted, capsys):
    (fitted / "corrections.json").write_text('{"corrections": [{"type": "trim", "frames": [-1]}]}')
    assert run(["view", "fitted", "--png", "a.png"]) == 2
    assert "corrections.json" in capsys.readouterr().err
    assert run(["correct", "fitted", "--undo", "all"]) == 0
    assert not (fitted / "corrections.json").exists()
    correct(fitted, [Trim((1, 2))])
    assert len(read_motion(fitted / "motion.safetensors")) > 1 == len(Result.open(fitted).motion)


def test_a_range_is_fitted_again_without_a_camera(desk, capsys):
    """Its poses are in a file beside, which goes with the correction."""
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))
    words = "fit walk --out out --estimator standing --stature 1.8 --no-pictures"
    assert run(words.split()) == 0
    before = Result.open("out").motion
    assert run("correct out --fit-again 2:4 --without cam_2".split()) == 0
    assert "1  frames 2–3 fitted again without cam_2" in capsys.readouterr().out
    after = Result.open("out").motion
    assert after.frames.tolist() == before.frames.tolist() == [1, 2, 3]
    # The estimator of these tests sees a body of 1.7 m then; the result keeps its own.
    assert np.array_equal(after.angles_rad, before.angles_rad)
    assert after.model.person == before.model.person
    assert np.array_equal(after.root_m[0], before.root_m[0])
    moved_m = after.landmarks()[1:].mean(axis=1) - waving(4).landmarks()[2:].mean(axis=1)
    assert np.abs(moved_m).max() < 1e-6
    # This estimator does as it likes: where it has a joint, that can be set, and nowhere else.
    joints_m = read_motion(desk / "out" / "fitted_again_1.safetensors").landmarks()[0]
    place = "{:.3f} {:.3f} {:.3f}".format(*joints_m[LANDMARK_NAMES.index("left_wrist")])
    assert run(["correct", "out", "--set-joints", f"left_wrist 2 {place}"]) == 0
    words = "2  frame 2 fitted again without cam_2 and with left_wrist set in frame 2"
    assert words in capsys.readouterr().out
    for words, line in (
        ("left_wrist 2 0 0 9", "left_wrist stays"),
        ("left_wirst 2 0 0 1", "did you mean left_wrist?"),
        ("left_wrist 0 0 0 1", "frame 0 has no pose"),
        ("left_wrist 2 0 0", "is not understood: give a joint, a frame"),
    ):
        assert run(["correct", "out", "--set-joints", words]) == 2
        assert line in capsys.readouterr().err
    assert run("fit walk --out out --estimator standing --overwrite".split()) == 2
    assert "out is corrected by hand, which would be lost" in capsys.readouterr().err
    assert run("correct out --undo all".split()) == 0
    assert not [*(desk / "out").glob("fitted_again*")]
    assert run("correct out --fit-again 2:4 --without cam_9".split()) == 2
    assert "there is no camera 'cam_9'" in capsys.readouterr().err


def test_the_viewer_corrects_and_shows_what_is_corrected(fitted):
    """What takes long is a command, where no studio does it."""
    result, made = Result.open(fitted), {"type": "trim", "frames": [2, 4]}
    motion, scenes = result.motion, ResultScenes(fitted, voxel_size_m=0.06)
    with closing(Browser(scenes, Address(port=8397), 1)) as browser:
        for corrections, frames in (([made], [2, 2]), ([], [0, 6])):
            post(browser, "corrections", {"corrections": corrections})
            with urlopen(f"{browser.url}/api/scene", timeout=60) as answer:
                scene = json.load(answer)
            assert [one["made"] for one in scene["corrections"]] == corrections
            assert [scene["first"], scene["count"]] == frames
            assert scene["first"] <= scene["shown"] < scene["first"] + scene["count"]
        place_m = motion.landmarks()[2, LANDMARK_NAMES.index("left_wrist")] + (0.02, 0.0, 0.01)
        seen = [(one.name, one.pinhole().project(place_m[None])[0][0]) for one in result.rig]
        pixels, frame = [[name, *pixel.tolist()] for name, pixel in seen], int(motion.frames[2])
        asked = {"frames": [frame, frame + 1], "joint": "left_wrist", "pixels": pixels}
        *words, told = shlex.split(post(browser, "fit_again", asked)["command"])
        assert words == ["voxelpose", "correct", str(fitted), "--set-joints"]
        joint, number, *place = told.split()
        assert (joint, number) == ("left_wrist", str(frame))
        assert np.abs(np.array(place, float) - place_m).max() < 0.002
        command = post(browser, "fit_again", {"frames": [2, 4], "camera": "cam_1"})["command"]
        assert command.endswith("fitted --fit-again 2:4 --without cam_1")
        write_corrections(fitted, [Trim((1, 4))])  # by somebody else
        with pytest.raises(HTTPError):
            post(browser, "corrections", {"corrections": []})
        assert (fitted / "corrections.json").exists()


def post(browser, path, content):
    url, kind = f"{browser.url}/api/{path}", {"Content-Type": "application/json"}
    with urlopen(Request(url, json.dumps(content).encode(), kind), timeout=60) as answer:
        return json.load(answer)
