"""voxelpose setup: its errors, and how it ends."""

import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.sources import ring, write_recording
from voxelpose.cli import run

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "nowhere is not a recording"),
        (["."], "holds no video"),
        (["walk", "--host", "0.0.0.0"], "protect the page with --token TOKEN"),
        (["walk", "--token", "short"], "--token is short"),
        (["walk", "--host", "no.such.host.invalid", "--token", "long enough"], "cannot be served"),
        (["walk", "--port", "70000"], "ports are numbers from 1 to 65535"),
    ],
)
def test_errors_are_one_line(desk, capsys, words, said):
    write_recording(desk / "walk", ring(2))
    assert run(["setup", *words, "--no-browser"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_settings_of_fit_that_make_no_sense_are_said_at_once(desk, capsys):
    write_recording(desk / "walk", ring(2))
    (desk / "walk" / "voxelpose.toml").write_text("[fit]\ntolerance = 'two'\n")
    assert run(["setup", "walk", "--no-browser"]) == 2
    assert "tolerance" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
def test_it_ends_cleanly_when_terminated(desk):
    write_recording(desk / "walk", ring(2))
    process = subprocess.Popen(
        [sys.executable, "-m", "voxelpose", "setup", "walk", "--no-browser", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        url = re.search(r"http://localhost:\d+", line)
        assert url is not None and "Ctrl-C" in line
        with urllib.request.urlopen(f"{url[0]}/api/state", timeout=20) as answer:
            assert b'"cam_1"' in answer.read()
        process.send_signal(signal.SIGTERM)
        out, error = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 0 and out == "" and error == ""
    assert sorted(path.name for path in (desk / "walk").iterdir()) == [
        "calibration.toml",
        "cam_1.mp4",
        "cam_2.mp4",
    ]
