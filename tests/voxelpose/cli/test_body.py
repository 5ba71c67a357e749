"""voxelpose body: the list, the choice, measurements and pictures."""

import cv2
import numpy as np
import pytest

from silhouette_core.body.presets import body_presets
from voxelpose.cli import run


def test_the_list_has_all_and_marks_what_is_computed(capsys):
    assert run(["body", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == [preset.name for preset in body_presets()]
    assert "1.70     0.92     0.80     (0.930)" in lines[4]
    assert "0.64*    0.91*" in lines[17]


def test_the_closest_is_told(capsys):
    assert run(["body", "choose", "--stature", "1.71", "--chest", "0.93", "--sex", "male"]) == 0
    assert capsys.readouterr().out.startswith("92A5 (male, JIS L 4004: stature 1.70 m, chest 0.92")
    assert run(["body", "choose", "--stature", "171"]) == 2
    assert "stature 171.0 m is not a person's" in capsys.readouterr().err


def test_a_body_is_measured_and_drawn(desk, capsys):
    assert run(["body", "show", "9ar", "--png", "body.png"]) == 0
    out = capsys.readouterr().out
    assert "waist        0.640 m" in out and "JIS L 4005 9AR" in out
    picture = cv2.imread(str(desk / "body.png"))
    quarters = np.array_split(picture, 4, axis=1)
    background = picture[0, 0]
    covered = [(quarter != background).any(2).mean() for quarter in quarters]
    assert min(covered) > 0.03 and covered[0] > covered[2]  # from the front more than from the side
    assert run(["body", "show", "9ar", "--png", "body.png"]) == 2
    assert "body.png exists" in capsys.readouterr().err


def test_all_bodies_in_one_picture(desk, capsys):
    assert run(["body", "show", "all", "--png", "all.png"]) == 0
    picture = cv2.imread(str(desk / "all.png"))
    cells = [cell for row in np.array_split(picture, 3) for cell in np.array_split(row, 8, 1)]
    heights = [np.ptp(np.flatnonzero((c[:250] != picture[0, 0]).any((1, 2)))) for c in cells]
    statures = [preset.measurements.stature_m for preset in body_presets()]
    np.testing.assert_allclose(heights / np.mean(heights), statures / np.mean(statures), rtol=0.02)
    assert run(["body", "show", "all"]) == 2
    assert "add --png" in capsys.readouterr().err


def test_a_body_is_made_and_shown_again(desk, capsys):
    made = ["body", "make", "--stature", "1.8", "--waist", "0.95", "--mass", "85", "--sex", "male"]
    assert run([*made, "--out", "me.toml"]) == 0
    table = capsys.readouterr().out.splitlines()[:-1]
    assert "stature      1.800 m" in table and "waist        0.950 m" in table
    assert "mass          85.0 kg" in table
    assert run(["body", "show", "me.toml"]) == 0
    assert capsys.readouterr().out.splitlines() == table
    assert run([*made, "--out", "me.toml"]) == 2
    assert "me.toml exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words, said",
    [
        (["show", "nobody"], "there is no body nobody"),
        (["make", "--stature", "1.8", "--out", "me.txt"], "is no body file"),
        (["make", "--stature", "180", "--out", "me.toml"], "is not a person's"),
        (["make", "--stature", "1.8", "--hip", "9", "--out", "me.toml"], "hip_girth_m 9 is not"),
    ],
)
def test_mistakes_are_one_line(desk, capsys, words, said):
    assert run(["body", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (desk / "me.toml").exists()
