"""What numba compiles for a command that has never run on this machine, and what that costs.

Usage: `python -m benchmarks.compilation [COMMAND ...] [--pairs N] [--write]`; by default `fit` and
`track` of the recording that `voxelpose demo` makes. Each command runs in a process of its own,
first with nothing compiled, then again; N pairs in turn. Prints wall and processor time of both
runs, their ratio, and the functions that took most processor time, each without those that it
calls, with the number of its signatures. The list is of a run without the process that compiles
beside a first run; the times are with it. With `--write`, kernels.toml of
`voxelpose.compile_ahead` is written anew.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import tomlkit
from numba.core import event

from voxelpose.compile_ahead import FILE

SHOWN = 20
ESTIMATORS = {"fit": "multiview", "track": "monocular"}


class CompileTimes(event.Listener):
    """Processor time of every compiled signature, without those of the functions that it calls.

    Attributes:
        seconds: by the function's name and its signature.
        called: kernels that are called from Python, in order, as in kernels.toml.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, dict[str, float]] = defaultdict(dict)
        self.called: list[str] = []
        self._open = threading.local()

    def on_start(self, event: event.Event) -> None:
        """Begins a signature."""
        self._stack.append([time.thread_time(), 0.0])

    def on_end(self, event: event.Event) -> None:
        """Ends it."""
        started, inner = self._stack.pop()
        elapsed = time.thread_time() - started
        if self._stack:
            self._stack[-1][1] += elapsed
        data: dict[str, Any] = event.data
        code = data["dispatcher"].py_func
        name = f"{code.__module__.rpartition('.')[2]}.{code.__name__}"
        self.seconds[name][str(data["args"])] = elapsed - inner
        if not self._stack:
            self.called.append(f"{code.__module__}.{code.__name__}{tuple(data['args'])!r}")

    @property
    def _stack(self) -> list[list[float]]:
        if not hasattr(self._open, "stack"):
            self._open.stack = []
        return self._open.stack


def measured(words: list[str], cache: Path, how: str = "--child") -> dict[str, Any]:
    """Wall and processor seconds of a command in a new process, and what it compiled."""
    child = [sys.executable, "-m", "benchmarks.compilation", how, *words]
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    ran = subprocess.run(child, env=environment, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found = json.loads(ran.stdout.splitlines()[-1])
    return {"wall": time.perf_counter() - started, "spent": spent, **found}


def print_table(compiled: dict[str, dict[str, float]]) -> None:
    """Prints the functions that took longest."""
    count = sum(map(len, compiled.values()))
    seconds = sum(sum(one.values()) for one in compiled.values())
    print(f"\n{len(compiled)} functions, {count} signatures, {seconds:.1f} s\n")
    print("| function | signatures | s |\n|---|---|---|")
    slowest = sorted(compiled.items(), key=lambda one: -sum(one[1].values()))
    for name, found in slowest[:SHOWN]:
        print(f"| {name} | {len(found)} | {sum(found.values()):.2f} |")
    several = [f"{name} {len(found)}" for name, found in slowest if len(found) > 1]
    print(f"\nmore than one signature: {', '.join(several) or 'none'}")


def compare(name: str, words: list[str], pairs: int) -> list[str]:
    """Prints the table of a command, and first and second runs in turn; returns its kernels."""
    print(f"\n## {name}")
    with tempfile.TemporaryDirectory() as folder:
        alone = measured(words, Path(folder), "--alone")
    print_table(alone["compiled"])
    for _ in range(pairs):
        with tempfile.TemporaryDirectory() as folder:
            first, second = (measured(words, Path(folder)) for _ in range(2))
        for kind in ("wall", "spent"):
            ratio = first[kind] / second[kind]
            print(
                f"{kind}: {first[kind]:.1f} s, again {second[kind]:.1f} s: {ratio:.2f} times",
                flush=True,
            )
        if second["compiled"]:
            print(f"compiled again: {', '.join(second['compiled'])}")
    return alone["called"]


def main() -> None:
    """Measures commands, or runs one in this process and prints what it compiled."""
    if sys.argv[1:2] in (["--child"], ["--alone"]):
        from voxelpose.cli import run
        from voxelpose.cli.terminal import Progress

        if sys.argv[1] == "--alone":
            Progress.note_compilation = lambda self, *estimators: None

        times = CompileTimes()
        event.register("numba:compile", times)
        run(sys.argv[2:])
        print(json.dumps({"compiled": times.seconds, "called": times.called}))
        return
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("commands", nargs="*", metavar="COMMAND")
    words.add_argument("--pairs", type=int, default=1)
    words.add_argument("--write", action="store_true")
    given = words.parse_args()
    from voxelpose.demo.room import make_recording

    with tempfile.TemporaryDirectory() as folder:
        made = str(make_recording(Path(folder) / "recording", 60))
        out = ["--out", str(Path(folder) / "out"), "--overwrite"]
        cases = {"fit": ["fit", made, *out], "track": ["track", made, "--camera", "cam_2", *out]}
        found = {name: compare(name, cases[name], given.pairs) for name in given.commands or cases}
    if given.write:
        kernels = {
            ESTIMATORS[name]: {"kernels": tomlkit.item(called).multiline(True)}
            for name, called in found.items()
        }
        FILE.write_text(tomlkit.dumps(kernels), encoding="utf-8")


if __name__ == "__main__":
    main()
