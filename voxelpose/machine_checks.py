"""Checks of an installation, with remedies for what does not work on this machine."""

from __future__ import annotations

import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

State = Literal["works", "limited", "fails"]

_OPENCV_WHEELS = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)
_MIN_FREE_GB = 1.0


@dataclass(frozen=True)
class HealthCheck:
    """Result of one check.

    Attributes:
        name: subject of the check.
        state: state of the subject; `limited` means that fitting works and something else does not.
        found: what the check observed.
        remedy: what the user can do; empty where nothing needs to be done.
    """

    name: str
    state: State
    found: str
    remedy: str = ""


def examine(folder: Path | None = None) -> list[HealthCheck]:
    """Checks everything that a fit needs, by trying it.

    Args:
        folder: folder in which results will be written; None for the current folder.

    Returns:
        One result per subject; a check that raises an exception is reported as failing.
    """
    folder = folder or Path.cwd()
    checks: dict[str, Callable[[], HealthCheck]] = {
        "Python": _python,
        "OpenCV": _opencv,
        "threads": _threads,
        "compiled code": _compiled,
        "compilation cache": _cache,
        "video": _video,
        "body and pictures": _pictures,
        "estimators": _estimators,
        "backends": _backends,
        "open3d": _open3d,
        "disk": lambda: _disk(folder),
    }
    findings = []
    for name, check in checks.items():
        try:
            findings.append(check())
        except Exception as error:  # any failure belongs in the report
            remedy = "install voxelpose again into a fresh environment"
            findings.append(HealthCheck(name, "fails", f"{type(error).__name__}: {error}", remedy))
    return findings


def _python() -> HealthCheck:
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    if sys.maxsize < 2**32:
        return HealthCheck("Python", "fails", f"{found}, 32 bit", "use a 64-bit Python")
    return HealthCheck("Python", "works", found)


def _opencv() -> HealthCheck:
    installed = [wheel for wheel in _OPENCV_WHEELS if _installed(wheel)]
    import cv2

    found = f"OpenCV {cv2.__version__} ({', '.join(installed) or 'not from a wheel'})"
    if len(installed) > 1:
        remedy = (
            f"these wheels overwrite each other: pip uninstall {' '.join(installed)}, then pip"
            " install opencv-python-headless"
        )
        return HealthCheck("OpenCV", "limited", found, remedy)
    return HealthCheck("OpenCV", "works", found)


def _installed(distribution: str) -> bool:
    try:
        version(distribution)
    except PackageNotFoundError:
        return False
    return True


def _threads() -> HealthCheck:
    from silhouette_core import jit

    cores, threads = jit.cores(), jit.set_threads()
    found = f"{cores} cores, {threads} threads"
    if threads < cores:
        return HealthCheck("threads", "limited", found, "unset NUMBA_NUM_THREADS to use all cores")
    return HealthCheck("threads", "works", found)


def _compiled() -> HealthCheck:
    import numba
    import numpy as np

    from silhouette_core.image.raster import render_parts

    corners = np.array([[-1.0, -1, 2], [1, -1, 2], [0, 1, 2]])
    parts, _ = render_parts(
        corners,
        np.array([[0, 1, 2]]),
        np.array([4]),
        np.array([[20.0, 0, 16], [0, 20, 16], [0, 0, 1]]),
        (32, 32),
    )
    found = f"numba {numba.__version__}, NumPy {np.__version__}"
    if parts[14, 16] != 5:
        return HealthCheck(
            "compiled code",
            "fails",
            f"{found}: a kernel returns wrong values",
            "delete __pycache__ folders, or set NUMBA_CACHE_DIR",
        )
    return HealthCheck("compiled code", "works", found)


def _cache() -> HealthCheck:
    import silhouette_core

    folders = [os.environ.get("NUMBA_CACHE_DIR", ""), str(Path(silhouette_core.__file__).parent)]
    for folder in filter(None, folders):
        parents = (Path(folder), *Path(folder).parents)
        if os.access(next(parent for parent in parents if parent.exists()), os.W_OK):
            return HealthCheck("compilation cache", "works", folder)
    remedy = (
        "set NUMBA_CACHE_DIR to a folder that you may write to; otherwise every command compiles"
        " again, for about a minute"
    )
    return HealthCheck("compilation cache", "limited", f"{folders[-1]} cannot be written", remedy)


def _video() -> HealthCheck:
    import cv2
    import numpy as np

    from calib.errors import InputError
    from voxelpose.view.images.webm import WebmWriter

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "try.webm"
        with suppress(OSError, InputError):
            writer = WebmWriter(path, 25, (64, 48))
            for grey in (60, 120, 180):
                writer.write(np.full((48, 64, 3), grey, np.uint8))
            writer.close()
        capture = cv2.VideoCapture(str(path))
        means = []
        while True:
            good, image = capture.read()
            if not good:
                break
            means.append(float(image.mean()))
        capture.release()
    if len(means) == 3 and np.allclose(means, (60, 120, 180), atol=6):
        return HealthCheck("video", "works", "WebM is written and read")
    remedy = (
        "install imageio-ffmpeg, or FFmpeg itself with its path in IMAGEIO_FFMPEG_EXE, for writing,"
        " and opencv-python-headless from PyPI for reading; folders of frames can be read and fits"
        " made with --no-pictures in any case"
    )
    return HealthCheck("video", "fails", f"of 3 frames written, {len(means)} were read", remedy)


def _pictures() -> HealthCheck:
    from silhouette_core.body.model import BodyModel
    from silhouette_core.body.sizes import BodySizes

    model = BodyModel.from_sizes(BodySizes(1.75))
    return HealthCheck(
        "body and pictures",
        "works",
        f"{len(model.names)} parts, {len(model.faces)} triangles; drawn without a screen",
    )


def _estimators() -> HealthCheck:
    from silhouette_core.estimator import GROUP, load_estimator

    return _registered("estimators", GROUP, load_estimator)


def _backends() -> HealthCheck:
    from silhouette_core.scoring.backend import GROUP, load_backend

    return _registered("backends", GROUP, load_backend)


def _registered(name: str, group: str, load: Callable[[str], object]) -> HealthCheck:
    """Checks that the classes of an entry point group can be loaded."""
    from silhouette_core.entry_points import registered

    names = sorted(registered(group))
    if not names:
        remedy = "install voxelpose (pip install -e . in a clone)"
        return HealthCheck(name, "fails", "none is registered", remedy)
    for registered_name in names:
        load(registered_name)
    return HealthCheck(name, "works", ", ".join(names))


def _open3d() -> HealthCheck:
    from calib.errors import InputError
    from voxelpose.view.open3d_import import import_open3d

    try:
        module = import_open3d()
    except InputError as error:  # states the remedy
        found, _, remedy = str(error).partition(": ")
        return HealthCheck("open3d", "limited", found, f"only `view --open3d` needs it: {remedy}")
    except Exception as error:  # a broken wheel raises anything
        remedy = (
            "only `view --open3d` needs it; on Linux: pip install libusb-package, and apt install"
            " libgl1 libgomp1"
        )
        return HealthCheck("open3d", "limited", f"{type(error).__name__}: {error}", remedy)
    screen = "a screen" if _has_screen() else "no screen here: use view --png"
    return HealthCheck("open3d", "works", f"{module.__version__}, {screen}")


def _has_screen() -> bool:
    return platform.system() != "Linux" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def _disk(folder: Path) -> HealthCheck:
    free = shutil.disk_usage(folder).free / 1e9
    found = f"{free:.1f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        return HealthCheck(
            "disk",
            "fails",
            f"{folder} cannot be written",
            "change to a folder that you may write to",
        )
    if free < _MIN_FREE_GB:
        return HealthCheck(
            "disk",
            "limited",
            found,
            "free some space: overlay videos need about 1 MB per second and camera",
        )
    return HealthCheck("disk", "works", found)
