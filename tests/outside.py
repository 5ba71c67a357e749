"""Packages of somebody else, as far as entry points go."""

from pathlib import Path

import pytest

from silhouette_core.scoring.backend import GROUP
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.scoring.outside_backend import ArrayBackend

METHODS = [name for name in vars(CpuBackend) if not name.startswith("_")]


def install_backend(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package with two scoring backends: `arrays`, and one that is invalid."""
    metadata = folder / "somebodys_backend-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: somebodys-backend\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        f"[{GROUP}]\narrays = {ArrayBackend.__module__}:ArrayBackend\n"
        "nothing = types:SimpleNamespace\n"
    )
    monkeypatch.syspath_prepend(str(folder))


def record_calls(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Returns a set into which every method of that backend writes its name when called; the
    project's own backend cannot be called any more.
    """
    called: set[str] = set()

    def recorded(name, method):
        return lambda *given, **named: called.add(name) or method(*given, **named)

    for name in METHODS:
        monkeypatch.setattr(ArrayBackend, name, recorded(name, getattr(ArrayBackend, name)))
        monkeypatch.delattr(CpuBackend, name)
    return called
