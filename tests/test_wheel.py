"""The wheel installs into a fresh environment and works there, away from the clone."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("calib", "silhouette_core", "voxelpose")


def run(*words, **options) -> str:
    """Runs a command; returns its output."""
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def fresh(tmp_path_factory) -> Path:
    """A fresh environment with the wheel installed; returns the folder of its programs.

    Installing the dependencies takes minutes (open3d alone has 400 MB), so that those of the
    current environment are used: a .pth file adds its site-packages to the path. The .pth file in
    there, through which the clone itself is importable, is not read that way.
    """
    folder = tmp_path_factory.mktemp("wheel")
    source, environment = folder / "source", folder / "environment"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    run(sys.executable, "-m", "pip", "wheel", source, "--no-deps", "--wheel-dir", folder)
    run(sys.executable, "-m", "venv", "--without-pip", environment)
    programs = environment / ("Scripts" if sys.platform == "win32" else "bin")
    python = programs / Path(sys.executable).name
    (wheel,) = folder.glob("voxelpose-*.whl")
    run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", wheel)
    site = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    (Path(site) / "dependencies.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    take_compiled(Path(site))
    return programs


def take_compiled(site: Path) -> None:
    """Copies the kernels that tests have compiled in the clone, since anew they take a minute.

    numba takes what it compiled from a file of the same content, size and time of modification.
    """
    for source in (file for name in PACKAGES for file in (ROOT / name).rglob("kernels/*.py")):
        installed = site / source.relative_to(ROOT)
        assert installed.read_bytes() == source.read_bytes()
        shutil.copystat(source, installed)
        (installed.parent / "__pycache__").mkdir(exist_ok=True)
        # The indices first: what a process beside this one compiles meanwhile is not in them.
        for kind in ("nbi", "nbc"):
            for compiled in (source.parent / "__pycache__").glob(f"{source.stem}.*.{kind}"):
                shutil.copy(compiled, installed.parent / "__pycache__")


@pytest.fixture
def away(tmp_path, monkeypatch) -> Path:
    """A current folder outside of the clone, without the settings of the current environment."""
    monkeypatch.chdir(tmp_path)
    for name in ("PYTHONPATH", "VIRTUAL_ENV", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    assert ROOT not in (Path.cwd(), *Path.cwd().parents)
    return tmp_path


@pytest.mark.slow
def test_the_demo_runs_from_the_wheel(fresh, away):
    python = fresh / Path(sys.executable).name
    for package in PACKAGES:
        file = run(python, "-c", f"import {package}; print({package}.__file__)").strip()
        assert fresh.parent in Path(file).parents
        for data in (ROOT / package).rglob("*.*"):
            if data.suffix in (".toml", ".safetensors", ".html", ".typed"):
                assert (Path(file).parent / data.relative_to(ROOT / package)).is_file(), data
    program = shutil.which("voxelpose", path=os.fspath(fresh))
    run(program, "demo", "--frames", "3", "--no-track", "--out", "demo")
    assert (away / "demo" / "result" / "contact_sheet.png").stat().st_size > 10_000
