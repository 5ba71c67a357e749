"""voxelpose view, on a recording that holds silhouettes of a posed body."""

import sys

import cv2
import pytest

from voxelpose.cli import run


@pytest.fixture
def fitted(staged, monkeypatch):
    """A result on a machine without a screen."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    return staged


def red_share(path) -> float:
    image = cv2.imread(str(path))
    assert image is not None
    return float(((image[..., 2].astype(int) - image[..., 0]) > 100).mean())


def test_hull_and_skeleton_as_a_picture(fitted, capsys):
    assert run(["view", "out", "--frame", "2", "--voxel", "0.03", "--png", "hull.png"]) == 0
    assert "frame 2" in capsys.readouterr().out
    assert run(["view", "walk", "--frame", "2", "--voxel", "0.03", "--png", "alone.png"]) == 0
    assert red_share("hull.png") > 0.002 > red_share("alone.png")


def test_hull_and_skeleton_as_a_video(fitted, capsys):
    assert run(["view", "out", "--voxel", "0.04", "--video", "hull.webm"]) == 0
    assert "hull.webm: 4 frames" in capsys.readouterr().out
    film = cv2.VideoCapture("hull.webm")
    pictures = [film.read()[1] for _ in range(4)]
    cv2.imwrite("last.png", pictures[3])
    cv2.imwrite("lost.png", pictures[0])
    # The first frame has a hull, but no pose.
    assert red_share("last.png") > 0.001 > red_share("lost.png")
    assert sorted(path.name for path in fitted.iterdir() if path.suffix == ".webm") == ["hull.webm"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("view out --open3d", "no screen"),
        ("view out --frame 0 --png x.png", "frame 0 has no pose in out: choose one from 1 to 3"),
        ("view walk --video x.webm", "walk is a recording without a fit"),
        ("view out --voxel 0.05 --video gone/x.webm", "gone/x.webm cannot be written"),
        ("view out --voxel 3 --png x.png", "--voxel = '3.0' must be a number"),
        ("view", "name the folder of a result, or a recording"),
        ("view out out --png x.png", "only the browser shows several results"),
        ("view out walk --no-browser", "walk is not a result of voxelpose"),
        ("view walk out --no-browser", "walk is no result: only results stand"),
        ("view nowhere --png x.png", "nowhere is not a recording"),
        (
            "view out --recording moved --png x.png",
            "the recording moved of this result is not there",
        ),
        ("view out --voxel 0.05 --png gone/x.png", "gone/x.png cannot be written"),
    ],
)
def test_mistakes(fitted, capsys, words, line):
    if "--open3d" in words and not sys.platform.startswith("linux"):
        pytest.skip("only Linux tells whether there is a screen")
    assert run(words.split()) == 2
    assert line in capsys.readouterr().err.splitlines()[-1]
    assert not (fitted / "x.png").exists()
