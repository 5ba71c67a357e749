"""Mutations of the code that tests should notice: python -m benchmarks.mutants [PATTERN ...]

Makes the small mistakes that benchmarks/mutants.toml lists (a sign, a comparison, a term left out),
one at a time in a copy of the project, and runs the tests beside each of them there. A mutation is
caught where one of these fails or takes too long; slow tests are left out. PATTERN chooses
mutations by a part of their file or description; left out: all (half an hour).

Writes a table, and names the survivors. The exit code is 1 where less than the floor was caught, of
those that are not explained as equivalent, and 2 where a test fails without any mutation.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "benchmarks" / "mutants.toml"
FLOOR = 0.95
LIMIT_S = 300.0
CAUGHT, SURVIVED, EQUIVALENT = "caught", "survived", "equivalent"
_LEFT_OUT = (".*", "out", "site", "build", "dist", "demo", "*.egg-info")


@dataclass(frozen=True)
class Mutant:
    """A small mistake in one file.

    Attributes:
        file: that it is made in, relative to the project.
        what: goes wrong.
        old: source text, found once in the file.
        new: what takes its place.
        tests: files or node ids that should notice.
        equivalent: why no test can; empty where one should.
    """

    file: str
    what: str
    old: str
    new: str
    tests: tuple[str, ...]
    equivalent: str = ""

    def __str__(self) -> str:
        return f"{self.file}: {self.what}"

    def applied(self, source: str) -> str:
        """The file's text with the mistake; raises ValueError where `old` is not there once."""
        if source.count(self.old) != 1:
            raise ValueError(f"{self}: {self.old!r} is there {source.count(self.old)} times")
        return source.replace(self.old, self.new)


def read_mutants(file: Path = LIST) -> list[Mutant]:
    """The listed mutations; `from` and `to` of the file are `old` and `new`."""
    known = {field.name for field in fields(Mutant)}
    mutants = []
    for entry in tomllib.loads(file.read_text(encoding="utf-8"))["mutant"]:
        entry |= {"old": entry.pop("from"), "new": entry.pop("to"), "tests": tuple(entry["tests"])}
        if unknown := set(entry) - known:
            raise ValueError(f"{file.name}: {', '.join(sorted(unknown))} of {entry['what']!r}")
        mutants.append(Mutant(**entry))
    return mutants


class Copy:
    """A copy of the project in which mistakes are made.

    Its compiled kernels are kept beside its files: those of other files are not compiled again.
    """

    def __init__(self, root: Path, folder: Path, limit_s: float = LIMIT_S):
        """Copies the project `root` into `folder`, which does not exist; limit of a run of tests in
        seconds.
        """
        left_out = shutil.ignore_patterns(*_LEFT_OUT)
        shutil.copytree(
            root,
            folder,
            # Of the project's own folder alone: voxelpose/demo is a package.
            ignore=lambda place, names: left_out(place, names) if Path(place) == root else set(),
        )
        self.folder, self.limit_s = folder, limit_s
        self._environment = os.environ | {
            "PYTHONPATH": str(folder),
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",  # starts a second sooner
            "VOXELPOSE_SHARED": os.environ.get("VOXELPOSE_SHARED", str(root.parent / "shared")),
        }
        self._environment.pop("NUMBA_CACHE_DIR", None)

    def judge(self, mutant: Mutant) -> str:
        """CAUGHT, SURVIVED or, where that was to be expected, EQUIVALENT."""
        with self._mutated(mutant):
            try:
                code, said = self.run(mutant.tests, self.limit_s, "-x")
            except subprocess.TimeoutExpired:
                return CAUGHT
        if code > 2:
            raise RuntimeError(f"{mutant}: pytest ends with {code}\n{said}")
        return CAUGHT if code else EQUIVALENT if mutant.equivalent else SURVIVED

    def run(
        self, tests: Iterable[str], limit_s: float | None = None, *options: str
    ) -> tuple[int, str]:
        """Exit code and output of pytest on some tests, without the slow ones."""
        words = "-q", "-m", "not (slow or accuracy)", "-p", "no:cacheprovider", *options
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words, *tests],
            cwd=self.folder,
            env=self._environment,
            timeout=limit_s,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        return done.returncode, done.stdout

    @contextmanager
    def _mutated(self, mutant: Mutant) -> Iterator[None]:
        """Makes the mistake for the time of a block."""
        file = self.folder / mutant.file
        before, times = file.read_bytes(), file.stat()
        compiled, aside = file.parent / "__pycache__", file.parent / "__aside__"
        aside.mkdir()
        try:
            # What was compiled from the file as it is comes back with it.
            for path in compiled.glob(f"{file.stem}.*"):
                path.rename(aside / path.name)
            file.write_text(mutant.applied(before.decode()), encoding="utf-8")
            yield
        finally:
            file.write_bytes(before)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
            for path in compiled.glob(f"{file.stem}.*"):
                path.unlink()
            for path in aside.iterdir():
                path.rename(compiled / path.name)
            aside.rmdir()


def tests_of(mutants: Iterable[Mutant]) -> list[str]:
    """All their tests, each once; a node id is left out where its whole file is named."""
    named = {test for mutant in mutants for test in mutant.tests}
    return sorted(test for test in named if "::" not in test or test.split("::")[0] not in named)


def table_of(verdicts: Sequence[tuple[Mutant, str]]) -> str:
    """Markdown table: numbers of each package, and of all."""
    lines = ["| package | mutations | caught | survived | equivalent |", "|---|---|---|---|---|"]
    packages = sorted({mutant.file.split("/")[0] for mutant, _ in verdicts})
    for package in (*packages, "all"):
        own = [end for mutant, end in verdicts if package in ("all", mutant.file.split("/")[0])]
        counts = (own.count(end) for end in (CAUGHT, SURVIVED, EQUIVALENT))
        lines.append(f"| {package} | {len(own)} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines)


def try_all(copy: Copy, mutants: Sequence[Mutant]) -> list[tuple[Mutant, str]]:
    """Verdicts on all mutations, with a line for each when it is known."""
    verdicts = []
    for count, mutant in enumerate(mutants, 1):
        start = time.perf_counter()
        verdicts.append((mutant, copy.judge(mutant)))
        took = f"{time.perf_counter() - start:5.0f} s"
        print(f"{count:4}/{len(mutants)} {took}  {verdicts[-1][1]:10}  {mutant}", flush=True)
    return verdicts


def main(arguments: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Tries the chosen mutations of the project `root`."""
    about, _, more = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser("python -m benchmarks.mutants", None, about, more)
    parser.add_argument("patterns", nargs="*", metavar="PATTERN")
    parser.add_argument("--floor", type=float, default=FLOOR, help="least fraction caught")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="of one mutation, seconds")
    chosen = parser.parse_args(arguments)
    mutants = [
        mutant
        for mutant in read_mutants(root / LIST.relative_to(ROOT))
        if not chosen.patterns or any(part in str(mutant) for part in chosen.patterns)
    ]
    if not mutants:
        print(f"no such mutation: {', '.join(chosen.patterns)}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as scratch:
        copy = Copy(root, Path(scratch) / root.name, chosen.limit)
        print(f"{len(mutants)} mutations; their tests without any first", flush=True)
        code, said = copy.run(tests_of(mutants))
        if code:
            print(said, file=sys.stderr)
            return 2
        verdicts = try_all(copy, mutants)
    ends = [end for _, end in verdicts]
    print(f"\n{table_of(verdicts)}")
    for mutant in (mutant for mutant, end in verdicts if end == SURVIVED):
        print(f"survived: {mutant}")
    for mutant in (mutant for mutant, end in verdicts if mutant.equivalent and end == CAUGHT):
        print(f"caught, though listed as equivalent: {mutant}")
    counted = len(ends) - ends.count(EQUIVALENT)
    return int(ends.count(CAUGHT) < chosen.floor * counted)


if __name__ == "__main__":
    sys.exit(main())
