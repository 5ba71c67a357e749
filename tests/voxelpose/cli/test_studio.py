"""voxelpose studio: its errors, how it ends, and how one gets there."""

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import psutil
import pytest

from tests.sources import ring, write_recording
from voxelpose.cli import run

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "there is no folder nowhere"),
        (["walk"], "walk is itself a recording: give the folder"),
        ([".", "--host", "0.0.0.0"], "protect the page with --token TOKEN"),
        ([".", "--port", "70000"], "ports are numbers from 1 to 65535"),
    ],
)
def test_errors_are_one_line(desk, capsys, words, said):
    write_recording(desk / "walk", ring(2))
    assert run(["studio", *words, "--no-browser"]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_without_words_the_program_says_how_to_begin(capsys):
    assert run([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("usage: voxelpose") and len(lines) < 8
    assert any(line.startswith("  voxelpose studio ") for line in lines)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_its_end_is_that_of_its_job(desk, number):
    write_recording(desk / "walk", ring(2))
    process = subprocess.Popen(
        [sys.executable, "-m", "voxelpose", "studio", "--no-browser", "--port", "0"],
        cwd=desk,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{desk / 'site'}"},
    )
    try:
        assert process.stdout is not None
        url = re.search(r"http://localhost:\d+", process.stdout.readline())
        assert url is not None
        settings = {"estimator": "standing", "voxel": 0.09}  # a second a frame
        asked = {"project": "walk", "command": "fit", "out": "out", "settings": settings}
        head = {"Content-Type": "application/json"}
        request = urllib.request.Request(f"{url[0]}/api/fit", json.dumps(asked).encode(), head)
        urllib.request.urlopen(request, timeout=20).close()
        children = psutil.Process(process.pid).children(recursive=True)
        end = time.monotonic() + 60
        while not list(desk.glob("out.partial*")):
            assert time.monotonic() < end
            time.sleep(0.1)
        process.send_signal(number)
        out, error = process.communicate(timeout=30)
    finally:
        process.kill()
    assert psutil.wait_procs(children, timeout=20)[1] == []
    if number != signal.SIGKILL:
        assert process.returncode == 0 and out == error == ""
        # The hidden one names the interrupted job.
        names = sorted(path.name for path in desk.iterdir())
        assert names == [".studio_jobs.json", "site", "walk"]
