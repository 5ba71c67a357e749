"""Processes ended at random: `python -m benchmarks.kills [--kills 100] [--seed 0] [COMMAND ...]`,
or `make kills`.

Every command is run once as it is, then ended again and again at a random moment by SIGKILL,
SIGTERM or SIGINT. After each: what was there before is as it was, or replaced by something
complete; what is there can be read; SIGTERM and SIGINT leave no traceback and nothing half-written.
After the next run of the same command nothing is left beside what an undisturbed run leaves.
Exit code 1 where any of this fails. Not for Windows.
"""

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.library_fuzz_targets import unlearned_proposal
from calib.files import read_rig
from examples.bodies.example_motions import example_motion
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.store import read_library, write_library
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.motion_file import write_motion
from voxelpose.demo.room import make_recording
from voxelpose.results import Result

# Python ends itself by SIGINT, which shells show as 130, where the interrupt met exec of a text.
_ENDED = (0, 130, -signal.SIGINT)
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


@dataclass(frozen=True)
class Command:
    """A command to be ended.

    Attributes:
        words: its arguments, in a folder that holds recording/, result/ and rig.toml.
        out: what it writes there.
        readable: reads it; raises if it cannot be read.
    """

    words: tuple[str, ...]
    out: str
    readable: Callable[[Path], object]


def _page(path: Path) -> None:
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>"), "half a page"


def _exports(folder: Path) -> None:
    lines = (folder / "joints.csv").read_text().splitlines()
    assert len({line.count(",") for line in lines}) == 1, "half a table"
    np.load(folder / "motion.npz")


COMMANDS = {
    "fit": Command(("fit", "recording", "--out", "fitted"), "fitted", Result.open),
    "fit --overwrite": Command(
        ("fit", "recording", "--out", "result", "--overwrite"), "result", Result.open
    ),
    "track": Command(
        (
            *("track", "recording", "--camera", "cam_2", "--out", "tracked"),
            *("--library", "lib.vplib", "--stature", "1.7"),
        ),
        "tracked",
        Result.open,
    ),
    "library build": Command(
        (
            *("library", "build", "lamp.safetensors", "--out", "new.vplib", "--poses", "400"),
            *("--body", "lamp.safetensors"),
        ),
        "new.vplib",
        read_library,
    ),
    "calibrate convert": Command(
        ("calibrate", "convert", "recording/calibration.toml", "rig.yml", "--overwrite"),
        "rig.yml",
        read_rig,
    ),
    "export": Command(
        ("export", "result", "--to", "csv,npz,bvh", "--out", "exports", "--overwrite"),
        "exports",
        _exports,
    ),
    "report": Command(("report", "result", "--overwrite"), "result/report.html", _page),
}


def prepare(folder: Path) -> None:
    """Makes what the commands read and replace."""
    make_recording(folder / "recording", 10)
    lamp, model = example_motion("desk_lamp", 100), BodyModel.from_sizes(BodySizes(1.7))
    write_motion(lamp, folder / "lamp.safetensors")
    clips, settings = {"wave": perform(movements()["wave"], model)}, LibrarySettings(poses=400)
    make_library(clips, model, folder / "lib.vplib", settings, learning=None)
    for words in (
        ("fit", "recording", "--out", "result"),
        COMMANDS["calibrate convert"].words,
        COMMANDS["export"].words,
        COMMANDS["report"].words,
    ):
        ended = start(words, folder)
        assert ended.wait() == 0, words
    library = folder / "lib.vplib"  # without a proposal no person is tracked
    write_library(replace(read_library(library), proposal=unlearned_proposal()), library)


def start(words: list[str] | tuple[str, ...], folder: Path) -> subprocess.Popen[str]:
    """Starts a command in a folder, with a folder of temporary files of its own."""
    (folder.parent / "tmp").mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-m", "voxelpose", *words],
        cwd=folder,
        env=os.environ | {"TMPDIR": str(folder.parent / "tmp")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def contents(folder: Path) -> dict[str, str]:
    """Digests of all files of a folder, by path."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def faults_of(
    command: Command, ready: Path, expected: set[str], delay_s: float, number: signal.Signals
) -> list[str]:
    """Runs a command in a copy of a folder, ends it, and returns what is wrong afterwards."""
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "desk"
        shutil.copytree(ready, folder)
        before = contents(folder)
        process = start(command.words, folder)
        time.sleep(delay_s)
        process.send_signal(number)
        error = process.communicate()[1]
        out = folder / command.out
        after = contents(folder)
        # While Python ends, after the work, SIGTERM has its usual effect.
        done = process.returncode == -signal.SIGTERM and after.keys() == expected
        if number != signal.SIGKILL and process.returncode not in _ENDED and not done:
            faults.append(f"exit code {process.returncode}")
        if "Traceback" in error:
            faults.append(f"a traceback: {error.splitlines()[-1]}")
        changed = [name for name in before if after.get(name) != before[name]]
        if any(not name.startswith(command.out) for name in changed):
            faults.append(f"changed: {', '.join(changed)}")
        if before.keys() & {command.out} and not out.exists():
            faults.append(f"{command.out} is lost")
        if out.exists():
            try:
                command.readable(out)
            except Exception as wrong:
                faults.append(f"{command.out} cannot be read: {wrong}")
        if number != signal.SIGKILL and (left := after.keys() - before.keys() - expected):
            faults.append(f"left: {', '.join(sorted(left)[:3])}")
        if out.exists() and "--overwrite" not in command.words and out.is_dir():
            shutil.rmtree(out)  # it was done
        again = start(command.words, folder)
        error = again.communicate()[1]
        if again.returncode:
            faults.append(f"the next run ends with {again.returncode}: {error.splitlines()[-1]}")
        names = set(contents(folder))
        if names != expected:
            faults.append(f"after the next run: {', '.join(sorted(names ^ expected)[:3])}")
        if scraps := list((Path(scratch) / "tmp").iterdir()):
            faults.append(f"temporary files: {', '.join(path.name for path in scraps[:3])}")
    return faults


def main(words: list[str] | None = None) -> int:
    """Runs the kills; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=", ".join(COMMANDS))
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(words)
    chosen = given.commands or list(COMMANDS)
    if unknown := set(chosen) - set(COMMANDS):
        parser.error(f"no such command: {', '.join(unknown)}")
    rng = np.random.default_rng(given.seed)
    count, failed = Counter[str](), 0
    with tempfile.TemporaryDirectory() as scratch:
        ready = Path(scratch) / "ready"
        ready.mkdir()
        prepare(ready)
        duration_s, expected = {}, {}
        for name in chosen:
            whole = Path(scratch) / "whole" / name
            shutil.copytree(ready, whole)
            begun = time.perf_counter()
            assert start(COMMANDS[name].words, whole).wait() == 0, name
            duration_s[name] = time.perf_counter() - begun
            expected[name] = set(contents(whole))
            print(f"{name}: {duration_s[name]:.1f} s when nothing ends it", flush=True)
        for k in range(given.kills):
            name, number = chosen[k % len(chosen)], SIGNALS[k // len(chosen) % len(SIGNALS)]
            delay_s = float(rng.uniform(0.05, 1.05)) * duration_s[name]
            faults = faults_of(COMMANDS[name], ready, expected[name], delay_s, number)
            count[f"{name}, {number.name}"] += 1
            failed += bool(faults)
            for fault in faults:
                print(f"{name}, {number.name} after {delay_s:.2f} s: {fault}", flush=True)
    for name, times in sorted(count.items()):
        print(f"{name}: {times}")
    print(f"{given.kills - failed} of {given.kills} without a fault")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
