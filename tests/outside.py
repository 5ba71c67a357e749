"""Packages of somebody else, as far as entry points go."""

from pathlib import Path

from silhouette_core.scoring.backend import GROUP
from silhouette_core.scoring.cpu import CpuBackend

METHODS = [name for name in vars(CpuBackend) if not name.startswith("_")]
# What Python runs as it starts: every process notes which backend is called.
_NOTING = """
import os
import sys
import time

from silhouette_core.scoring.cpu import CpuBackend


def noted(name, method):
    def call(self, *given, **named):
        started = time.thread_time()
        result = method(self, *given, **named)
        seconds = time.thread_time() - started
        if sys._getframe(1).f_globals["__name__"] != "silhouette_core.monocular.tree.tree":
            with open(os.environ["CALLS"], "a") as calls:
                calls.write(f"{type(self).__name__} {name} {os.getpid()} {seconds}\\n")
        return result

    return call


for name in METHODS:
    setattr(CpuBackend, name, noted(name, getattr(CpuBackend, name)))
"""


class CountedBackend(CpuBackend):
    """Scores as the program's own, under a name of its own."""


def install_backends(folder: Path) -> None:
    """Writes a package with three scoring backends, one of which is invalid, into a folder to be
    put on the path.
    """
    metadata = folder / "somebodys_backend-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: somebodys-backend\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        f"[{GROUP}]\nnumpy = examples.numpy_backend:NumpyBackend\n"
        f"counted = {__name__}:CountedBackend\nnothing = types:SimpleNamespace\n"
    )


def note_calls(folder: Path) -> None:
    """Lets all processes that have the folder on their path note every call of a method, but for
    tree building, in the file that the variable CALLS names: "CLASS METHOD PROCESS SECONDS".
    """
    (folder / "sitecustomize.py").write_text(f"METHODS = {METHODS}\n{_NOTING}")
