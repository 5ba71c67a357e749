"""voxelpose export, on the result of a fit."""

import json

import numpy as np
import pytest

from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.motion_file import write_motion
from tests.clips import waving
from voxelpose.cli import run


def test_beside_the_result_and_again(fitted, capsys):
    before = {path.name for path in fitted.iterdir()}
    for _ in range(2):
        assert run(["export", "fitted"]) == 0
    output = capsys.readouterr().out.split()
    assert "fitted/motion.glb" in output
    assert {path.name for path in fitted.iterdir()} - before == {
        *("motion.glb", "motion.trc", "motion.mot", "motion.c3d", "motion.npz"),
        *("joints_wide.csv", "angles.csv", "export.json"),
    }


def test_elsewhere(fitted, desk, capsys):
    assert run(["export", "fitted", "--to", "GLB, csv", "--out", "lab"]) == 0
    names = {"motion.glb", "joints.csv", "joints_wide.csv", "angles.csv", "export.json"}
    assert {path.name for path in (desk / "lab").iterdir()} == names
    assert run(["export", "fitted", "--to", "glb", "--out", "lab"]) == 2
    assert "lab/motion.glb exists" in capsys.readouterr().err
    assert run(["export", "fitted", "--to", "glb", "--out", "lab", "--overwrite"]) == 0


def test_what_is_not_as_in_the_result_is_apart_from_it(fitted, capsys):
    before = (fitted / "motion.bvh").read_bytes()
    words = ["export", "fitted", "--to", "bvh", "--skeleton", "unity", "--rate", "50"]
    assert run([*words, "--in-place", "--frames", "0:4"]) == 0
    assert "fitted/export/motion.bvh" in capsys.readouterr().out
    assert (fitted / "motion.bvh").read_bytes() == before
    assert "LeftUpperArm" in (fitted / "export" / "motion.bvh").read_text()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["fitted", "--to", "obj"], "there is no format 'obj'"),
        (["fitted", "--frames", "900:"], "none of these frames has a pose"),
        (["fitted", "--rate", "0"], "--rate"),
        (["fitted", "--to", ","], "--to names no format"),
        (["walk"], "walk is not a result"),
        (["fitted", "--filter", "none"], "fitted does not record its filter"),
    ],
)
def test_mistakes(fitted, capsys, words, line):
    assert run(["export", *words, "--out", "lab"]) == 2
    assert line in capsys.readouterr().err


def test_another_filter_than_the_result_s(fitted, desk, capsys):
    given = waving(40, fps=50.0).select(np.r_[0:20, 22:40])
    write_motion(conditioned(given, Conditioning(filter_order=3)), fitted / "motion.safetensors")
    kept = (fitted / "motion.safetensors").read_bytes()
    words = ["export", "fitted", "--to", "npz", "--out", "lab", "--overwrite"]
    assert run([*words, "--filter", "gaussian", "--cutoff", "4", "--gap-limit", "0.04s"]) == 0
    found = np.load(desk / "lab" / "motion.npz")
    expected = conditioned(given, Conditioning("gaussian", 4.0, gap_limit=2))
    np.testing.assert_array_equal(found["root_m"], expected.root_m)
    np.testing.assert_array_equal(found["frames"][found["filled"]], [20, 21])
    assert run([*words, "--gap-limit", "5"]) == 0  # the rest is as in the result
    said = json.loads((desk / "lab" / "export.json").read_text())["files"]["motion.npz"]
    assert said["conditioning"]["order"] == 3
    assert capsys.readouterr().err == ""
    assert run([*words, "--cutoff", "30"]) == 0
    assert "note: not filtered: 50 frames per second are too few" in capsys.readouterr().err
    assert (fitted / "motion.safetensors").read_bytes() == kept


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--cutoff", "-3"], "a cut-off of -3 Hz cannot be used"),
        (["--gap-limit", "soon"], "gap limit 'soon' is not understood"),
        (["--filter", "gaussian", "--filter-order", "2"], "has no order"),
    ],
)
def test_filters_that_are_none(fitted, capsys, words, line):
    write_motion(conditioned(waving(20), Conditioning()), fitted / "motion.safetensors")
    assert run(["export", "fitted", *words]) == 2
    assert line in capsys.readouterr().err
