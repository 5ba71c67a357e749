"""Fixtures that every test may use, and how worker processes share the tests out (`make test`)."""

import gc
import importlib
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("VOXELPOSE_SHARED", Path(__file__).resolve().parents[2] / "shared"))
# Folder of the pose network that is installed on this machine; tests see none unless they ask.
NETWORK = os.environ.pop("VOXELPOSE_NETWORK", None)
os.environ["VOXELPOSE_NETWORK"] = str(Path(tempfile.gettempdir()) / "voxelpose-no-network")
# Name of this worker process of pytest-xdist; None where one process runs all tests.
WORKER = os.environ.get("PYTEST_XDIST_WORKER")
# Their session fixtures take long to make: one worker runs them all.
TOGETHER = (
    "tests/silhouette_core/monocular/test_",
    "tests/silhouette_core/monocular/tree/",
    "tests/silhouette_core/monocular/tracking/",
    "tests/silhouette_core/monocular/making/test_learning.py",
)

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As under `nohup … &`: what tests begin would ignore interrupts, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Hardly any of what is imported, collected and compiled is garbage: it is looked for less often.
gc.set_threshold(100_000)
if WORKER:
    # Before NumPy is loaded: the other cores have workers of their own.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def unit_of(nodeid: str) -> str:
    """Returns the unit of a test, which one worker runs as a whole: its file, or `TOGETHER`."""
    return "together" if nodeid.startswith(TOGETHER) else nodeid.split("::")[0]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """Gives every worker the next unit when it is done with one."""
    # pytest-xdist's own groups (--dist loadgroup) have no effect with pytest 9.2.
    from xdist.scheduler import LoadScopeScheduling

    class UnitScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return unit_of(nodeid)

    config.option.loadscopereorder = False
    return UnitScheduling(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """For workers, puts the units with the most slow tests first, so that all end together."""
    if WORKER:
        slow = Counter(unit_of(item.nodeid) for item in items if item.get_closest_marker("slow"))
        items.sort(key=lambda item: -slow[unit_of(item.nodeid)])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """In a worker, kernels use one thread unless a test, or what it calls, says otherwise."""
    if WORKER:
        from silhouette_core.jit import set_threads

        set_threads(1)


def pytest_sessionstart() -> None:
    """Lets workers compile kernels once, and write numba's index of them one after the other."""
    # Two that save different signatures of one kernel at once would take the same file name.
    if WORKER:
        from numba.core.caching import IndexDataCacheFile

        save = IndexDataCacheFile.save
        lock = Path(tempfile.gettempdir()) / f"numba-{os.environ['PYTEST_XDIST_TESTRUNUID']}"

        def save_alone(self, key, data) -> None:
            with _locked(lock):
                save(self, key, data)

        IndexDataCacheFile.save = save_alone
        _compile_share(int(WORKER.removeprefix("gw")))


def _compile_share(number: int) -> None:
    """Compiles a worker's share of what the estimators need, or loads it: their first tests would
    compile the same at the same time.
    """
    from silhouette_core.progress import SilentReporter
    from voxelpose.compile_ahead import compile_kernels, kernels

    wanted = kernels(["multiview", "monocular"])
    modules = sorted({module for module, _, _ in wanted})
    own = modules[number :: int(os.environ["PYTEST_XDIST_WORKER_COUNT"])]
    compile_kernels([kernel for kernel in wanted if kernel[0] in own], SilentReporter())


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Holds a lock between processes: the folder exists as long as one of them has it."""
    end = time.monotonic() + 30  # a worker that was killed leaves its lock behind
    while time.monotonic() < end:
        with suppress(FileExistsError):
            folder.mkdir()
            break
        time.sleep(0.01)
    try:
        yield
    finally:
        with suppress(OSError):
            folder.rmdir()


@pytest.fixture(scope="session")
def shared() -> Path:
    """Returns the folder of shared recordings that stands beside the project, or skips."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"no shared recordings at {SHARED} (set VOXELPOSE_SHARED)")
    return SHARED


@pytest.fixture
def pose_network(monkeypatch) -> Path:
    """Installs the machine's pose network for a test and returns its file, or skips."""
    from silhouette_core.network_files import FOLDER_VARIABLE, installed_network

    monkeypatch.delenv(FOLDER_VARIABLE)
    if NETWORK is not None:
        monkeypatch.setenv(FOLDER_VARIABLE, NETWORK)
    path = installed_network()
    if path is None:
        pytest.skip("no pose network is installed: make network")
    return path


@pytest.fixture
def beside(monkeypatch):
    """Imports a module of the benchmarks, which are not installed: they stand beside the tests."""
    root = Path(__file__).resolve().parents[1]
    if not (root / "benchmarks" / "__main__.py").exists():
        pytest.skip("no benchmarks beside the tests")
    monkeypatch.syspath_prepend(str(root))
    yield lambda name: importlib.import_module(f"benchmarks.{name}")
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        del sys.modules[name]


@pytest.fixture
def rig_files(beside):
    """The writers of small rigs of every format, and `box_mesh`."""
    return beside("rig_fuzz_targets")
