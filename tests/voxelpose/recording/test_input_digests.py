"""What changed in a recording since its fit, as `report` and `view` say."""

import json
import re
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib.camera import Rig
from calib.files import read_rig, write_rig
from tests.clips import waving
from tests.sources import open_desk, ring, write_staged
from voxelpose.cli import run
from voxelpose.results import Result
from voxelpose.view.viewer.result_scenes import ResultScenes

KNEW = "changed in the recording since the fit, which knew them otherwise: "


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A result "out" of the recording "walk", which has a region and settings."""
    with pytest.MonkeyPatch.context() as patch:
        desk = open_desk(tmp_path_factory.mktemp("made"), patch)
        write_staged(desk / "walk", waving(3), ring(3, (320, 240)))
        (desk / "walk" / "regions").mkdir()
        white = np.full((240, 320), 255, np.uint8)
        cv2.imwrite(str(desk / "walk" / "regions" / "cam_1.png"), white)
        settings = "[fit]\nsex = 'male'\n[track]\nsex = 'male'\n"
        (desk / "walk" / "voxelpose.toml").write_text(settings)
        assert run("fit walk --out out --estimator standing --no-pictures".split()) == 0
    return desk


@pytest.fixture
def fitted(desk, made):
    """A copy of what is made."""
    for name in ("walk", "out"):
        shutil.copytree(made / name, desk / name)
    return desk


def draw_unknown(walk):
    (walk / "recording.toml").write_text("[unknown]\ncam_2 = [[[0, 0], [9, 0], [9, 9]]]\n")


def draw_region(walk):
    image = cv2.imread(str(walk / "regions" / "cam_1.png"))
    image[:9] = 0
    cv2.imwrite(str(walk / "regions" / "cam_1.png"), image)


def calibrate_anew(walk):
    first, *others = read_rig(walk / "calibration.toml")
    moved = replace(first, translation=first.translation + 0.01)
    write_rig(Rig((moved, *others)), walk / "calibration.toml")


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (draw_unknown, "unknown places"),
        (draw_region, "regions"),
        (calibrate_anew, "calibration"),
        (lambda walk: (walk / "subject.toml").write_text("stature = 1.9\n"), "settings"),
        (lambda walk: (walk / "voxelpose.toml").write_text("[fit]\nsex = 'female'\n"), "settings"),
    ],
)
def test_what_changed_is_told(fitted, change, names):
    change(fitted / "walk")
    assert ResultScenes("out").changed == f"{KNEW}{names}"


def test_pages_and_pictures_say_what_changed(fitted, capsys):
    draw_unknown(fitted / "walk")
    draw_region(fitted / "walk")
    words = f"{KNEW}regions, unknown places"
    assert run(["report", "out"]) == 0
    assert f"note: {words}\n" in capsys.readouterr().err
    text = re.sub("<[^>]*>", "", (fitted / "out" / "report.html").read_text())
    assert f"{words[:1].upper()}{words[1:]}." in text
    assert run(["view", "out", "--png", "hull.png"]) == 0
    assert f"note: {words}\n" in capsys.readouterr().out
    scenes = ResultScenes("out")
    assert words in scenes.scene(1).notes
    scenes.close()


def test_what_means_the_same_is_no_change(fitted):
    settings = "# a remark\n[fit]\nsex = 'male'\n[track]\nsex = 'female'\n"
    notes = "name = 'S07'\ndate = 2026-11-28\nremarks = 'barefoot'\n"
    (fitted / "walk" / "subject.toml").write_text(notes)
    (fitted / "walk" / "voxelpose.toml").write_text(settings)
    region = fitted / "walk" / "regions" / "cam_1.png"
    cv2.imwrite(str(region), np.full((240, 320), 200, np.uint8))  # light enough for white
    assert len(Result.open("out").summary["inputs"]) == 5
    (fitted / "walk").rename(fitted / "moved")
    assert ResultScenes("out", fitted / "moved").changed == ""


def test_a_result_of_before_says_nothing(fitted):
    summary = fitted / "out" / "summary.json"
    content = json.loads(summary.read_text())
    del content["inputs"]
    summary.write_text(json.dumps(content))
    calibrate_anew(fitted / "walk")
    assert ResultScenes("out").changed == ""
