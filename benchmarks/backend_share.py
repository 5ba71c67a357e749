"""Processor time that the scoring backend takes of each command:

    python -m benchmarks.backend_share RECORDING STATURE_M [COMMAND ...]

Each runs twice, with one thread, the first time to compile what it needs; seconds are those of all
its processes, the start included.
"""

import os
import resource
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from tests.outside import note_calls

ROOT = Path(__file__).resolve().parents[1]
_FEW = ("--frames", "0:20", "--threads", "1", "--no-pictures", "--overwrite", "--out", "result")
_LIVE = ("live", "--no-page", "--fps", "5", "--duration", "20")
_ONE = ("--camera", "cam_1", "--start", "any")
PROGRAM = (sys.executable, "-m", "voxelpose")
COMMANDS = {
    "fit": ("fit", *_FEW),
    "track": ("track", *_FEW, *_ONE),
    "track --method paper": ("track", *_FEW, *_ONE, "--method", "paper"),
    "live, several cameras": _LIVE,
    "live, one camera": (*_LIVE, "--cameras", "cam_1"),
}


def seconds_of(words: tuple[str, ...], recording: Path, stature_m: str) -> tuple[float, dict]:
    """Returns the processor seconds of a command, and those of each method of the backend."""
    with tempfile.TemporaryDirectory() as folder:
        note_calls(Path(folder))
        path = os.pathsep.join([folder, str(ROOT)])
        threads = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [*PROGRAM, words[0], recording, *words[1:], "--stature", stature_m],
            cwd=folder,
            env=os.environ | threads | {"PYTHONPATH": path, "CALLS": "calls.txt"},
            check=True,
            capture_output=True,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        methods: dict[str, float] = defaultdict(float)
        for line in Path(folder, "calls.txt").read_text().splitlines():
            _, method, _, seconds = line.split()
            methods[method] += float(seconds)
    whole = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return whole, methods


def main(recording: str, stature_m: str, *names: str) -> None:
    """Prints a row for each command."""
    for name in names or COMMANDS:
        for _ in range(2):
            whole, methods = seconds_of(COMMANDS[name], Path(recording).resolve(), stature_m)
        carried = sum(methods.values())
        each = ", ".join(f"{method} {seconds:.2f}" for method, seconds in sorted(methods.items()))
        row = name, f"{whole:.1f}", f"{carried:.2f}", f"{carried / whole:.1%}", each
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
