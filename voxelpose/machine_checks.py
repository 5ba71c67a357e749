"""Checks of an installation, with remedies for what does not work on this machine."""

from __future__ import annotations

import importlib
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib.metadata import Distribution
from pathlib import Path

from voxelpose.findings import Finding, Level

_OPENCV_WHEELS = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)
_MIN_FREE_GB = 1
_Checked = tuple[Level, str, str]
"""Level, words and remedy of a `Finding`."""


def examine() -> list[Finding]:
    """Checks everything that a fit needs, by trying it; results are written to the current folder.
    What is bad fails, as a check that raises an exception does; `look`: it is limited, but fitting
    works.
    """
    checks: dict[str, Callable[[], _Checked]] = {
        "Python": _python,
        "OpenCV": _opencv,
        "threads": _threads,
        "compiled code": _compiled,
        "compilation cache": _cache,
        "video": _video,
        "body and pictures": _pictures,
        "estimators": partial(_registered, "estimator", "load_estimator"),
        "backends": partial(_registered, "scoring.backend", "load_backend"),
        "pose network": _network,
        "open3d": _open3d,
        "disk": _disk,
    }
    findings = []
    for name, check in checks.items():
        try:
            level, words, remedy = check()
        except Exception as error:  # any failure belongs in the report
            level, words = "bad", f"{type(error).__name__}: {error}"
            remedy = "install voxelpose again into a fresh environment"
        findings.append(Finding(name, level, words, remedy=remedy))
    return findings


def _python() -> _Checked:
    finding = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    if sys.maxsize < 2**32:
        return "bad", f"{finding}, 32 bit", "use a 64-bit Python"
    return "good", finding, ""


def _opencv() -> _Checked:
    installed = [wheel for wheel in _OPENCV_WHEELS if _installed(wheel)]
    import cv2

    finding = f"OpenCV {cv2.__version__} ({', '.join(installed) or 'not from a wheel'})"
    if len(installed) > 1:
        remedy = (
            f"these wheels overwrite each other: pip uninstall {' '.join(installed)}, then pip"
            " install opencv-python-headless"
        )
        return "look", finding, remedy
    return "good", finding, ""


def _installed(distribution: str) -> bool:
    return any(Distribution.discover(name=distribution))


def _threads() -> _Checked:
    from silhouette_core import jit

    cores, threads = jit.cores(), jit.set_threads()
    finding = f"{cores} cores, {threads} threads"
    if threads < cores:
        return "look", finding, "unset NUMBA_NUM_THREADS to use all cores"
    return "good", finding, ""


def _compiled() -> _Checked:
    import numba
    import numpy as np

    from silhouette_core.image.raster import render_parts

    corners = np.array([[-1.0, -1, 2], [1, -1, 2], [0, 1, 2]])
    matrix = np.array([[20.0, 0, 16], [0, 20, 16], [0, 0, 1]])
    parts, _ = render_parts(corners, np.array([[0, 1, 2]]), np.array([4]), matrix, (32, 32))
    finding = f"numba {numba.__version__}, NumPy {np.__version__}"
    if parts[14, 16] != 5:
        remedy = "delete __pycache__ folders, or set NUMBA_CACHE_DIR"
        return "bad", f"{finding}: a kernel returns wrong values", remedy
    return "good", finding, ""


def _cache() -> _Checked:
    from silhouette_core import jit

    if not jit.CACHE_IS_TEMPORARY:
        return "good", str(jit.CACHE), ""
    remedy = (
        "set NUMBA_CACHE_DIR to a lasting folder that you may write to; otherwise the program is"
        " compiled again, for about a minute, whenever temporary files were removed"
    )
    finding = f"{jit.CACHE}: neither the installation nor the home folder can be written"
    return "look", finding, remedy


def _video() -> _Checked:
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
        while (read := capture.read())[0]:
            means.append(float(read[1].mean()))
        capture.release()
    if len(means) == 3 and np.allclose(means, (60, 120, 180), atol=6):
        return "good", "WebM is written and read", ""
    remedy = (
        "install imageio-ffmpeg, or FFmpeg itself with its path in IMAGEIO_FFMPEG_EXE, for writing,"
        " and opencv-python-headless from PyPI for reading; folders of frames can be read and fits"
        " made with --no-pictures in any case"
    )
    return "bad", f"of 3 frames written, {len(means)} were read", remedy


def _pictures() -> _Checked:
    from silhouette_core.body.model import BodyModel
    from silhouette_core.body.sizes import BodySizes

    model = BodyModel.from_sizes(BodySizes(1.75))
    counts = f"{len(model.names)} parts, {len(model.faces)} triangles"
    return "good", f"{counts}; drawn without a screen", ""


def _registered(module: str, load: str) -> _Checked:
    """Checks that the classes of an entry point group can be loaded."""
    from silhouette_core.entry_points import registered

    known = importlib.import_module(f"silhouette_core.{module}")
    names = sorted(registered(known.GROUP))
    if not names:
        return "bad", "none is registered", "install voxelpose (pip install -e . in a clone)"
    for name in names:
        getattr(known, load)(name)
    return "good", ", ".join(names), ""


def _network() -> _Checked:
    from silhouette_core.image.pose_network import Crop, PoseNetwork
    from silhouette_core.network_files import installed_network

    path = installed_network()
    if path is None:
        remedy = "`voxelpose network install` gets one for rooms in which silhouettes are poor"
        return "look", "not installed", remedy
    import numpy as np

    grey = PoseNetwork(path).look(np.full((256, 256, 3), 127, np.uint8), Crop(128, 128, 256))
    if grey.presence < 0.5:
        return "good", str(path), ""
    return "bad", f"{path}: sees somebody in a grey picture", "install another version of OpenCV"


def _open3d() -> _Checked:
    from calib.errors import InputError
    from voxelpose.view.open3d_import import has_screen, import_open3d

    needs = "only `view --open3d` and `evaluate --scan` need it"
    try:
        module = import_open3d()
    except InputError as error:  # states the remedy
        finding, _, remedy = str(error).partition(": ")
        return "look", finding, f"{needs}: {remedy}"
    except Exception as error:  # a broken wheel raises anything
        remedy = f"{needs}; on Linux: pip install libusb-package, and apt install libgl1 libgomp1"
        return "look", f"{type(error).__name__}: {error}", remedy
    screen = "a screen" if has_screen() else "no screen here: use view --png"
    return "good", f"{module.__version__}, {screen}", ""


def _disk() -> _Checked:
    folder = Path.cwd()
    free = shutil.disk_usage(folder).free / 1e9
    finding = f"{free:.1f} GB free in {folder}"
    if not os.access(folder, os.W_OK):
        remedy = "change to a folder that you may write to"
        return "bad", f"{folder} cannot be written", remedy
    if free < _MIN_FREE_GB:
        remedy = "free some space: overlay videos need about 1 MB per second and camera"
        return "look", finding, remedy
    return "good", finding, ""
