"""Compiled code is kept in a private temporary folder where nothing else can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# As numba finds it in a read-only installation with a home folder that cannot be written.
LOCKED = """
from numba.core import caching
caching.CacheImpl._locator_classes = [caching.UserProvidedCacheLocator]
from silhouette_core import jit
"""


def locked(script: str, folder: Path) -> str:
    """What a script prints in a new process without a place for numba's cache."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(folder)}
    environment.pop("NUMBA_CACHE_DIR", None)
    ended = subprocess.run(
        [sys.executable, "-c", LOCKED + script],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout + ended.stderr


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="TMPDIR is not Windows' word for it")
def test_kernels_are_kept_in_a_private_folder(tmp_path):
    kept = tmp_path / f"voxelpose-{os.getuid()}" / "compiled"
    where = "import os; print(jit.CACHE, jit.CACHE_IS_TEMPORARY, os.environ['NUMBA_CACHE_DIR'])\n"
    assert locked(where, tmp_path) == f"{kept} True {kept}\n"
    compile_one = (
        "from voxelpose.machine_checks import examine\n"
        "found = {check.about: check for check in examine()}\n"
        "cache = found['compilation cache']\n"
        "print(found['compiled code'].level, cache.level, cache)\n"
    )
    said = locked(compile_one, tmp_path)
    assert said.startswith("good look ")
    assert str(kept) in said and "set NUMBA_CACHE_DIR to a lasting folder" in said
    assert any(kept.rglob("*.nbi"))
    assert kept.parent.stat().st_mode & 0o777 == 0o700


def test_the_first_run_says_once_where(tmp_path):
    note = (
        "from voxelpose.cli.terminal import Progress\n"
        "Progress().note_compilation()\n"
        "(jit.CACHE / 'a').mkdir(parents=True); (jit.CACHE / 'a' / 'b.nbi').touch()\n"
        "Progress().note_compilation()\n"
    )
    said = locked(note, tmp_path)
    assert said.count("it is kept in") == said.count("first run on this machine") == 1
    assert "NUMBA_CACHE_DIR names a folder that lasts" in said
