"""Damaged files for every reader: `python -m benchmarks.fuzz [TARGET ...] [--mutations N]
[--seed S]`, or `make fuzz` for 10,000 mutations of each.

A mutation fails unless the reader, and what works with what it read, ends in success or in an
InputError of one line that names the file. It fails, too, if it takes over 2 s, adds over 1 GiB of
memory, or ends the process. Printed are a table in Markdown, and for every kind of failure the
command that repeats one of them: `--only NUMBER` runs a single mutation in this process, with its
traceback, and `--keep FOLDER` leaves the mutated files there. `--list` lists the targets.
"""

import argparse
import json
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from benchmarks.fuzz_targets import TARGETS, FuzzTarget
from benchmarks.mutations import mutated, mutation_of
from calib.errors import InputError

LIMIT_S = 2.0
LIMIT_MIB = 1024
_THOROUGH = 100  # one run in so many is the command itself
_THOROUGH_S = 20.0
_SILENT_S = 60.0  # without a word, a process hangs
_BATCH = 5000  # mutations of a process
_LONGEST_LINE = 1000
_SPARE = 4 << 30  # bytes of address space: what asks for more gets no memory


@dataclass
class Tally:
    """What became of the mutations of a target.

    Attributes:
        mutations: how many there were.
        refused: how many ended in an InputError.
        failures: kind of failure -> numbers of the mutations.
        slowest_s: longest time of a mutation that did not fail.
    """

    mutations: int = 0
    refused: int = 0
    failures: dict[str, list[int]] = field(default_factory=dict)
    slowest_s: float = 0.0

    def add(self, word: dict) -> None:
        """Adds a mutation as its process tells of it."""
        self.mutations += 1
        self.refused += word.get("refused", 0)
        if "failure" in word:
            self.failures.setdefault(word["failure"], []).append(word["number"])
        else:
            self.slowest_s = max(self.slowest_s, word.get("seconds", 0.0))

    @property
    def failed(self) -> int:
        """Number of failures."""
        return sum(map(len, self.failures.values()))


class Bench:
    """The files of a target in a folder, one of which is mutated for every run."""

    def __init__(self, name: str, folder: Path, seed: int) -> None:
        """Writes the valid files and runs the target on them.

        Args:
            name: of the target.
            folder: empty.
            seed: of the mutations.
        """
        self.name, self.folder, self.seed = name, folder, seed
        self.target: FuzzTarget = TARGETS[name]
        self.target.make(folder / self.target.opened)
        self._valid = {path: (folder / path).read_bytes() for path in self.target.files}
        # A message may call a file by its own name, or its folder's.
        parts = [Path(path).parts for path in self._valid]
        self._names = {part for own in parts for part in (own[0], own[-1])}
        self._there = {path for path in folder.rglob("*") if path.is_file()}
        self.target.run(folder, False)

    def write(self, number: int) -> str:
        """Writes a mutated file among the valid ones; returns its path in the folder."""
        rng = Random(f"{self.seed} {self.name} {number}")
        chosen = rng.choice(sorted(self._valid))
        for path, content in self._valid.items():
            new = mutated(content, mutation_of(path), rng) if path == chosen else content
            (self.folder / path).write_bytes(new)
        return chosen

    def run(self, number: int) -> dict:
        """Runs the target on a mutation; returns what became of it."""
        self.write(number)
        thorough = number % _THOROUGH == _THOROUGH - 1
        word: dict = {"number": number}
        begun_s, worked_s, before_mib = time.perf_counter(), time.process_time(), _peak_mib()
        try:
            self.target.run(self.folder, thorough)
        except InputError as error:
            word["refused"] = 1
            text = str(error)
            if len(text) > _LONGEST_LINE:
                word["failure"] = f"InputError of more than {_LONGEST_LINE} characters"
            elif "\n" in text.strip():
                word["failure"] = "InputError of several lines"
            elif not any(part in text for part in self._names):
                word["failure"] = "InputError without the name of the file"
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            own = [
                frame
                for frame in traceback.extract_tb(error.__traceback__)
                if "site-packages" not in frame.filename and "benchmarks" not in frame.filename
            ]
            where = own[-1] if own else where
            place = f"{Path(where.filename).name}:{where.name}"
            word["failure"] = f"{type(error).__name__} in {place}"
        # The smaller of both: on a busy machine the clock counts the others' work as well.
        word["seconds"] = min(time.perf_counter() - begun_s, time.process_time() - worked_s)
        if "failure" not in word and word["seconds"] > (_THOROUGH_S if thorough else LIMIT_S):
            word["failure"] = f"over {LIMIT_S:g} s"
        if _peak_mib() - before_mib > LIMIT_MIB:
            word["failure"] = f"over {LIMIT_MIB} MiB"
        for path in [path for path in self.folder.rglob("*") if path.is_file()]:
            if path not in self._there:
                path.unlink()
        return word


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def work(name: str, seed: int, first: int, last: int) -> None:
    """Runs mutations in this process and tells of each in a line of JSON."""
    warnings.simplefilter("ignore")
    told = os.fdopen(os.dup(1), "w")
    # What libraries print must not come between the lines.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(name, Path(folder), seed)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + _SPARE
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        for number in range(first, last):
            print(json.dumps({"begun": number}), file=told, flush=True)
            print(json.dumps(bench.run(number)), file=told, flush=True)


def _lines(process: subprocess.Popen[str]) -> Iterator[str]:
    """Lines of a process; it is ended if it is silent for too long."""
    lines: queue.Queue[str | None] = queue.Queue()

    def feed() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)
        lines.put(None)

    threading.Thread(target=feed, daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=_SILENT_S)
        except queue.Empty:
            process.kill()
            return
        if line is None:
            return
        yield line


def _worker(name: str, seed: int, first: int, last: int) -> list[str]:
    """Command of a process that runs mutations, see `work`."""
    words = [sys.executable, "-m", "benchmarks.fuzz", name, "--seed", str(seed)]
    return [*words, "--work", str(first), str(last)]


def fuzz(name: str, mutations: int, seed: int) -> Tally:
    """Runs mutations of a target in processes of their own.

    Args:
        name: of the target.
        mutations: how many.
        seed: of the mutations.

    Returns:
        What became of them.
    """
    tally, number = Tally(), 0
    while number < mutations:
        last = min(mutations, number + _BATCH)
        words = _worker(name, seed, number, last)
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        begun = None
        try:
            for line in _lines(process):
                word = json.loads(line)
                if "begun" in word:
                    begun = word["begun"]
                else:
                    tally.add(word)
                    begun, number = None, word["number"] + 1
        finally:
            if process.poll() is None and number < last and begun is None:
                process.kill()
            code = process.wait()
        if begun is None and number < last:
            raise RuntimeError(f"the process of {name} ended with code {code} between mutations")
        if begun is not None:
            kind = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            hung = "hangs" if kind == "SIGKILL" else f"the process ended: {kind}"
            tally.add({"number": begun, "failure": hung})
            number = begun + 1
    return tally


def table(tallies: dict[str, Tally]) -> str:
    """Returns tallies as a Markdown table."""
    lines = ["| reader | mutations | refused | failed | slowest s |", "|---|---|---|---|---|"]
    for name, tally in tallies.items():
        cells = (name, f"{tally.mutations:,}", f"{tally.refused:,}", str(tally.failed))
        lines.append(f"| {' | '.join(cells)} | {tally.slowest_s:.2f} |")
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Runs the targets; returns 1 if any mutation failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--mutations", type=int, default=200, help="of each target; 200")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, metavar="NUMBER", help="run one mutation, here")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="with --only: of its files")
    parser.add_argument("--list", action="store_true", help="list the targets")
    parser.add_argument("--work", type=int, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.list:
        print("\n".join(TARGETS))
        return 0
    unknown = [name for name in given.targets if name not in TARGETS]
    if unknown:
        print(f"no target {', '.join(unknown)}; there are {', '.join(TARGETS)}", file=sys.stderr)
        return 2
    if given.work is not None:
        work(given.targets[0], given.seed, *given.work)
        return 0
    if given.only is not None:
        return _repeat(given.targets[0], given.seed, given.only, given.keep)
    tallies = {}
    for name in given.targets or TARGETS:
        tallies[name] = fuzz(name, given.mutations, given.seed)
        for kind, numbers in Counter(
            {kind: len(numbers) for kind, numbers in tallies[name].failures.items()}
        ).most_common():
            example = tallies[name].failures[kind][0]
            again = f"python -m benchmarks.fuzz {name} --seed {given.seed} --only {example}"
            print(f"{name}: {numbers} x {kind}; again: {again}", file=sys.stderr, flush=True)
    print(table(tallies))
    return int(any(tally.failed for tally in tallies.values()))


def _repeat(name: str, seed: int, number: int, keep: Path | None) -> int:
    """Runs one mutation in this process, with its traceback."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(name, Path(folder), seed)
        print(f"mutated: {bench.write(number)}")
        if keep is not None:
            shutil.copytree(folder, keep, dirs_exist_ok=True)
            print(f"files: {keep}", flush=True)
        try:
            bench.target.run(bench.folder, number % _THOROUGH == _THOROUGH - 1)
        except InputError as error:
            print(f"InputError: {error}")
        word = bench.run(number)
        print(word)
    return int("failure" in word)


if __name__ == "__main__":
    sys.exit(main())
