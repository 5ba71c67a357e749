"""The doctor sees what is broken, and says what to do."""

import pytest

from voxelpose import machine_checks as doctor
from voxelpose.cli import run


def found(name):
    return {finding.about: finding for finding in doctor.examine()}[name]


@pytest.mark.parametrize(
    "name", ["Python", "OpenCV", "compiled code", "video", "body and pictures"]
)
def test_what_the_tests_need_works(name):
    assert found(name).level != "bad"


def test_broken_encoder_is_a_failure_with_a_remedy(monkeypatch, capsys):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/true")  # writes nothing
    finding = found("video")
    assert (finding.level, finding.words) == ("bad", "of 3 frames written, 0 were read")
    assert "imageio-ffmpeg" in finding.remedy
    assert run(["doctor"]) == 1
    assert "imageio-ffmpeg" in capsys.readouterr().out


def test_colliding_opencv_wheels_are_named(monkeypatch):
    monkeypatch.setattr(doctor, "_installed", lambda wheel: "contrib" not in wheel)
    assert found("OpenCV").level == "look"
    assert "pip uninstall opencv-python opencv-python-headless" in found("OpenCV").remedy


def test_estimators_and_backends_are_listed():
    assert found("estimators").words == "monocular, multiview, tree"
    assert found("backends").words == "cpu"


def test_little_space_is_said(monkeypatch, tmp_path):
    usage = type("Usage", (), {"free": 3e8})
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda folder: usage)
    assert found("disk").level == "look"


def test_a_check_that_breaks_is_a_finding(monkeypatch):
    monkeypatch.setattr(doctor, "_threads", lambda: 1 / 0)
    assert "ZeroDivisionError" in found("threads").words
