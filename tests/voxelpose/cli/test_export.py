"""voxelpose export, on the result of a fit."""

import pytest

from tests.sources import ring, write_recording
from voxelpose.cli import run


@pytest.fixture
def fitted(desk, capsys):
    write_recording(desk / "walk", ring(2))
    assert (
        run(
            [
                "fit",
                "walk",
                "--out",
                "fitted",
                "--estimator",
                "standing",
                "--stature",
                "1.8",
                "--no-pictures",
            ]
        )
        == 0
    )
    capsys.readouterr()
    return desk / "fitted"


def test_beside_the_result_and_again(fitted, capsys):
    before = {path.name for path in fitted.iterdir()}
    for _ in range(2):
        assert run(["export", "fitted"]) == 0
    output = capsys.readouterr().out.split()
    assert "fitted/motion.glb" in output
    assert {path.name for path in fitted.iterdir()} - before == {
        "motion.glb",
        "motion.trc",
        "motion.mot",
        "motion.c3d",
        "joints_wide.csv",
        "angles.csv",
        "motion.npz",
    }


def test_elsewhere(fitted, desk, capsys):
    assert run(["export", "fitted", "--to", "GLB, csv", "--out", "lab"]) == 0
    assert {path.name for path in (desk / "lab").iterdir()} == {
        "motion.glb",
        "joints.csv",
        "joints_wide.csv",
        "angles.csv",
    }
    assert run(["export", "fitted", "--to", "glb", "--out", "lab"]) == 2
    assert "lab/motion.glb exists" in capsys.readouterr().err
    assert run(["export", "fitted", "--to", "glb", "--out", "lab", "--overwrite"]) == 0


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["fitted", "--to", "fbx"], "there is no format 'fbx'"),
        (["fitted", "--to", ","], "--to names no format"),
        (["walk"], "walk is not a result"),
    ],
)
def test_mistakes(fitted, capsys, words, line):
    assert run(["export", *words, "--out", "lab"]) == 2
    assert line in capsys.readouterr().err
