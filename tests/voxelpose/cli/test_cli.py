"""The command line as a user meets it: another process, its words and its exit code."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.clips import waving
from tests.sources import ring, write_recording, write_staged
from voxelpose.cli import COMMANDS, run
from voxelpose.cli.options import load_command, options_of

ROOT = Path(__file__).resolve().parents[3]
HEAVY = ("numpy", "scipy", "cv2", "numba", "open3d", "trimesh", "rich.progress", "safetensors")


@pytest.fixture(autouse=True)
def walk(desk):
    """A recording on the desk."""
    write_recording(desk / "walk", ring(2))


def start(desk, *words, code="from voxelpose.cli import main; main()"):
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{desk / 'site'}"}
    # A shell's background job is born deaf to Ctrl-C, and so would be what the tests start from
    # there.
    hearing = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler); {code}"
    return subprocess.Popen(
        [sys.executable, "-c", hearing, *words],
        cwd=desk,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


@pytest.mark.parametrize("words", [["fit", "--help"], ["--version"]])
def test_whoever_reads_the_output_may_go(desk, words):
    process = start(desk, *words)
    process.stdout.close()
    assert process.wait(timeout=120) == 141
    assert process.stderr.read() == ""
    process.stderr.close()


def left(desk):
    return sorted(path.name for path in desk.iterdir() if path.name not in ("site", "walk"))


def test_help_is_light(desk):
    code = f"""
import sys
from voxelpose.cli import COMMANDS, run
for words in ([], *([name] for name in COMMANDS)):
    try:
        run([*words, "--help"])
    except SystemExit as end:
        assert end.code == 0
    print("loaded:", [name for name in {HEAVY!r} if name in sys.modules])
"""
    returned, out, err = ended(start(desk, code=code))
    assert returned == 0, err
    helps = out.split("loaded: ")
    for name, text, loaded in zip(["", *COMMANDS], helps[:-1], helps[1:], strict=True):
        assert loaded.splitlines()[0] == "[]", name
        assert f"voxelpose {name}" in text


def seconds_of(desk, *words, **code) -> float:
    """Time of the processor, since other processes may be busy."""
    before = os.times()
    assert ended(start(desk, *words, **code))[0] == 0
    return sum(os.times()[2:4]) - sum(before[2:4])


def test_help_answers_at_once(desk, monkeypatch):
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)  # compiled once, as by users
    # By turns, so that both meet the same machine; the least of each is what they need.
    needed = "import numpy, tyro"
    pairs = [(seconds_of(desk, code=needed), seconds_of(desk, "fit", "--help")) for _ in range(3)]
    reference, seconds = map(min, zip(*pairs, strict=True))
    assert seconds < 2.5 * reference  # 1.4 times; with SciPy, Numba and OpenCV 5


@pytest.mark.parametrize("name", ["fit", "track", "live"])
def test_help_shows_groups_which_hold_all_options(monkeypatch, capsys, name):
    monkeypatch.setenv("COLUMNS", "129")  # one column of boxes
    with pytest.raises(SystemExit):
        run([name, "--help"])
    boxes = re.split(r"\n (\w[\w ]*\w) +\n -{5,}", capsys.readouterr().out)[1:]
    groups = dict(zip(boxes[::2], boxes[1::2], strict=True))
    titles = [f"{word} options" for word in ("basic", "person", "camera", "output", "expert")]
    assert list(groups) == ["positional arguments", "options", *titles]
    assert "--stature" in groups["basic options"] and "--sex" in groups["person options"]
    assert "--fps" in groups["camera options"]
    for option in options_of(load_command(name)):
        assert sum(bool(re.search(rf"\n +--{option}\b[^-]", box)) for box in boxes[1::2]) == 1, (
            option
        )


@pytest.mark.parametrize("width", [80, 120])
def test_help_fits_the_terminal(monkeypatch, capsys, width):
    monkeypatch.setenv("COLUMNS", str(width))
    for name in COMMANDS:
        with pytest.raises(SystemExit):
            run([name, "--help"])
    examples = ("  ", "usage: ")  # as they are to be typed, and as tyro prints them
    lines = capsys.readouterr().out.splitlines()
    lines = [line for line in lines if "voxelpose " not in line or not line.startswith(examples)]
    assert max(map(len, lines)) <= width


def test_version(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("voxelpose 0.")


def test_fit_writes_and_says_where(desk):
    returned, out, err = ended(
        start(desk, "fit", "walk", "--out", "fitted", "--estimator", "standing", "--stature", "1.8")
    )
    assert returned == 0, err
    assert "5 of 6 frames have a pose" in out
    assert "fitted" in out and "motion.bvh" in out
    assert "standing about" in err
    assert left(desk) == ["fitted"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("fit run --out x", "run is not a recording"),
        ("fit walk --out x --frames a:b", "--frames a:b is not understood"),
        ("fit walk --out x --frames 4:9", "frames 4:9 are not in the recording"),
        ("fit walk --out x --estimator telepathy", "no estimator is called 'telepathy'"),
        ("fit walk --out x --backend abacus", "no backend is called 'abacus': installed are cpu"),
        (
            "track walk --camera cam_1 --out x --backend abacus",
            "no backend is called 'abacus': installed are cpu",
        ),
        ("network install --from no.whl", "no.whl cannot be read"),
        ("fit walk --out walk --estimator standing", "walk lies in the recording"),
        ("fit walk --out site --estimator standing", "site exists"),
        (
            "fit walk --out site --estimator standing --overwrite",
            "site exists and was not made by this command",
        ),
        ("fit walk --out x --cameras cam_1,cam_7", "there is no camera cam_7"),
        ("fit walk --out x --cameras ,", "--cameras names none"),
        ("carve walk --out x.ply --frame 99", "frames 99:100 are not in the recording"),
        ("carve walk --out x.ply", "no foreground in any camera"),
        ("carve walk --out x.ply --tolerance -1", "--tolerance = '-1' must be a whole"),
        ("evaluate walk truth.json", "truth.json cannot be read"),
        ("sing", "there is no command 'sing'"),
    ],
)
def test_a_users_mistake_is_one_line_and_code_2(desk, capsys, words, line):
    assert run(words.split()) == 2
    captured = capsys.readouterr()
    message = captured.err.splitlines()[-1]
    assert message.startswith("voxelpose: ")
    assert line in message
    assert "Traceback" not in captured.err
    assert left(desk) == []


@pytest.mark.parametrize(
    "words", ["fit", "fit walk", "fit walk --out x --stature tall", "fit walk --colour"]
)
def test_wrong_arguments_end_with_code_2(words, capsys):
    with pytest.raises(SystemExit) as end:
        run(words.split())
    assert end.value.code == 2
    assert capsys.readouterr().err


def test_a_bug_keeps_its_traceback(desk):
    returned, _, err = ended(
        start(desk, "fit", "walk", "--out", "fitted", "--estimator", "standing", "--voxel", "0.08")
    )
    assert returned == 1
    assert "Traceback" in err and "RuntimeError: a bug" in err
    assert left(desk) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals to send")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_fit_says_how_far_it_came_and_leaves_nothing(desk, number):
    process = start(
        desk, "fit", "walk", "--out", "fitted", "--estimator", "standing", "--voxel", "0.09"
    )
    deadline = time.monotonic() + 60
    while not left(desk) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(1.5)
    process.send_signal(number)
    returned, _, err = ended(process)
    assert returned == 130, err
    last = err.splitlines()[-1]
    assert (
        last.startswith("voxelpose: interrupted during standing about, after ") and "of 6" in last
    )
    assert "Traceback" not in err
    assert left(desk) == []


@pytest.mark.parametrize("command", ["fit", "carve"])
def test_a_tolerance_that_leaves_no_hull_is_refused(desk, capsys, command):
    write_staged(desk / "dance", waving(2), ring(3, (320, 240)))
    for tolerance in ("2", "3", "99"):
        assert run([command, "dance", "--out", "out", "--tolerance", tolerance]) == 2
        assert f"--tolerance {tolerance} is impossible with 3 cameras: give 0 to 1" in (
            capsys.readouterr().err
        )


def test_no_threads_are_refused(desk, capsys):
    assert run(["library", "build", "walk", "--out", "lib.vplib", "--threads", "0"]) == 2
    assert "--threads = '0' must be a whole number from 1" in capsys.readouterr().err
