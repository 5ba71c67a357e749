"""Compilation of kernels before they are needed: for installers, and beside a first run.

kernels.toml names what the estimators compile, in the order in which they need it; `python -m
benchmarks.compilation --write` writes it. numba keeps what is compiled in its cache.
"""

import gc
import importlib
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from silhouette_core import jit
from silhouette_core.jit import compile_for
from silhouette_core.progress import Reporter

FILE = Path(__file__).with_name("kernels.toml")


def kernels(estimators: Iterable[str], last_first: bool = False) -> list[tuple[str, str, str]]:
    """Module, function and numba's signature of all that estimators compile, each once; nothing is
    known of an estimator that is not in the file. `last_first` turns those of each round.
    """
    tables = tomllib.loads(FILE.read_text(encoding="utf-8"))
    order = -1 if last_first else 1
    lines = [
        line for name in estimators for line in tables.get(name, {}).get("kernels", [])[::order]
    ]
    entries = []
    for line in dict.fromkeys(lines):
        path, bracket, types = line.partition("(")
        entries.append((*path.rsplit(".", 1), bracket + types))
    return entries


def compile_kernels(wanted: Sequence[tuple[str, str, str]], reporter: Reporter) -> None:
    """Compiles kernels, see `kernels`, or loads those that are compiled."""
    reporter.stage("compiling", len(wanted))
    for module, function, types in wanted:
        compile_for(getattr(importlib.import_module(module), function), types)
        reporter.advance()


@contextmanager
def compiling_beside(reporter: Reporter, estimators: Sequence[str]) -> Iterator[None]:
    """Notes that this run compiles, where nothing is compiled yet; meanwhile a process beside it
    compiles what estimators need, the last first, so that they meet in the middle.
    """
    if next(jit.CACHE.rglob("*.nbi"), None) is not None:
        yield
        return
    reporter.note(
        "first run on this machine: the program is compiled, once; later runs are much faster"
    )
    if jit.CACHE_IS_TEMPORARY:
        reporter.note(
            f"it is kept in {jit.CACHE}, since neither the installation nor the home folder can be"
            " written: NUMBA_CACHE_DIR names a folder that lasts"
        )
    # Compiling makes many objects and hardly any garbage: looking for it took a tenth.
    gc.set_threshold(100_000)
    if not estimators:
        yield
        return
    words = [sys.executable, "-m", __name__, *estimators]
    silent = subprocess.DEVNULL
    with subprocess.Popen(words, stdin=silent, stdout=silent, stderr=silent) as process:
        try:
            yield
        finally:
            process.terminate()


if __name__ == "__main__":
    from silhouette_core.progress import SilentReporter

    gc.disable()
    compile_kernels(kernels(sys.argv[1:], last_first=True), SilentReporter())
