"""Text from files and names is shown, and controls neither the terminal nor rich's markup."""

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from calib.errors import visible
from tests.clips import waving
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.cli.terminal import Progress, VisibleStream, message, plain
from voxelpose.demo.room import make_recording


class Screen(io.StringIO):
    """What is written to a terminal."""

    def isatty(self):
        return True


HOSTILE = "\x1b[31mred\x07\x9b2J\u202e[bold]"


def test_control_characters_are_visible():
    assert visible(HOSTILE) == r"\x1b[31mred\x07\x9b2J\u202e[bold]"
    assert visible("ä\t\n") == "ä\t\n"
    assert visible("a\u061cb\u200d\ufeff\xad") == r"a\u061cb\u200d\ufeff\xad"
    assert visible("a\udcff") == r"a\udcff"
    assert plain("[bold]") == r"\[bold]"


def test_a_message_is_one_line_of_bounded_length():
    assert message("a\n b") == "a b"
    assert len(message("x" * 100_000)) < 1100


def test_a_stream_writes_nothing_else():
    stream = io.StringIO()
    print(HOSTILE, file=VisibleStream(stream))
    assert stream.getvalue() == visible(HOSTILE) + "\n"


def test_names_are_printed_as_they_are(desk, capsys):
    name = "x[/red] walk[bold] a\x1b[31m"
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))
    assert run(["fit", "walk", "--out", name, "--estimator", "standing", "--no-pictures"]) == 0
    out = capsys.readouterr().out
    assert visible(name) in out
    assert "\x1b[31m" not in out


def test_a_name_that_is_no_text_is_refused(desk, capsys):
    assert run(["carve", "walk\udcff", "--out", "hull.ply"]) == 2
    assert r"walk\udcff is not UTF-8" in capsys.readouterr().err


def test_doctor_removes_what_a_killed_run_left(desk, capsys):
    (desk / "out.partial-2147483000-0123abcd").mkdir()
    assert run(["doctor", "--clean", "."]) == 0
    assert "removed out.partial-" in capsys.readouterr().out
    assert run(["doctor", "--clean", "."]) == 0
    assert "left nothing" in capsys.readouterr().out
    assert run(["doctor", "--clean", "missing"]) == 2


def test_an_interrupt_after_the_result_says_that_it_is_there(desk, capsys, monkeypatch):
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("voxelpose.results.Result.open", interrupted)
    words = ["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]
    assert run(words) == 130
    error = capsys.readouterr().err
    assert "interrupted" in error and "written before: " in error and f"{desk / 'out'}\n" in error
    assert "nothing was written" not in error


@pytest.mark.slow
def test_a_fit_that_is_killed_leaves_nothing_after_the_next(desk):
    make_recording(desk / "walk", 4)
    words = ["fit", "walk", "--out", "out", "--estimator", "standing"]
    paths = os.pathsep.join([str(desk / "site"), str(Path(__file__).parents[3])])
    with subprocess.Popen(
        [sys.executable, "-m", "voxelpose", *words], env=os.environ | {"PYTHONPATH": paths}
    ) as process:
        while not any(desk.glob("out.partial-*/overlay_*.webm")):  # pictures are being drawn
            assert process.poll() is None
            time.sleep(0.005)
        process.kill()
    assert not (desk / "out").exists()
    assert any(desk.glob("out.partial-*"))
    assert run([*words, "--no-pictures", "--frames", "0:2"]) == 0
    assert names(desk) == ["out", "walk"]


def test_one_bar_over_all_stages_which_never_moves_back(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Screen())
    with Progress({"reading": 6, "tracking": 2}) as progress:
        (bar,) = progress._bar.tasks
        moved = []
        for name, total, steps in (
            ("reading", 4, 2),
            ("a look around", None, 1),
            ("tracking", 2, 1),
            ("reading", 4, 1),
        ):
            progress.stage(name, total)
            progress.advance(steps)
            moved.append(bar.completed)
        assert moved == [3 / 8, 3 / 8, 7 / 8, 7 / 8] and bar.total == 1
        assert progress.where() == "during reading, after 1 of 4 steps"
    assert len(progress._bar.tasks) == 1 and bar.finished


def test_a_bar_without_shares_begins_anew_with_each_stage(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Screen())
    with Progress() as progress:
        progress.stage("one", 4)
        progress.advance(3)
        progress.stage("two", 8)
        progress.advance()
        (bar,) = progress._bar.tasks
        assert (bar.description, bar.completed, bar.total) == ("two", 1, 8)


def test_the_verdict_is_first_and_timings_only_if_wanted(desk, capsys):
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))
    words = ["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]
    assert run(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("doubtful: 1 of 4 frames have no pose")
    assert not any("mean ms" in line for line in lines)
    assert run([*words, "--overwrite", "--verbose"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["stage", "min", "ms", "max", "ms", "mean", "ms"] in lines
    assert ["standing", "2.0", "2.0", "2.0"] in lines


def names(folder):
    return sorted(path.name for path in folder.iterdir() if path.name != "site")
