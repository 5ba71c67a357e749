"""Options of numba, for all compiled kernels."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Waiting threads sleep: spinning ones would occupy the cores that video decoding needs.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import cv2
import numba
from numba.core.caching import FunctionCache
from numba.core.sigutils import normalize_signature

from calib.errors import InputError
from calib.storage.temporary import private_folder


def _cache_folder() -> tuple[Path, bool]:
    """Folder of the compiled kernels, and whether it is a temporary one, where neither
    NUMBA_CACHE_DIR nor the installation nor the user's cache folder can be written.
    """
    try:
        return Path(FunctionCache(_cache_folder).cache_path).parent, False
    except RuntimeError:  # numba finds no place
        folder = str(private_folder() / "compiled")
        os.environ["NUMBA_CACHE_DIR"] = folder  # for processes that this one begins
        numba.config.CACHE_DIR = folder  # type: ignore[attr-defined]
        return Path(folder), True


CACHE, CACHE_IS_TEMPORARY = _cache_folder()

# error_model "numpy": no division checks. nogil: kernels may run in parallel with video decoding.
# fastmath stays off, so that results are the same on every machine of one architecture and for
# every number of threads.
kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
# For what one thread does alone: threads within a kernel carry nothing where several things are
# worked on side by side, and compiling takes half as long again.
parallel_kernel = numba.njit(cache=True, nogil=True, error_model="numpy", parallel=True)
prange = numba.prange


def compile_for(function: Any, types: str) -> None:
    """Compiles a kernel for arguments of types, or loads what is compiled.

    Args:
        function: the kernel.
        types: as numba writes them, such as "(Array(float64, 2, 'C', False, aligned=True), int64)".
    """
    # Text would be another key of the cache than the types of a call.
    function.compile(normalize_signature(types)[0])


def check_threads(threads: int | None) -> None:
    """Checks a number of threads; None is all. Raises InputError where it is less than one."""
    if threads is not None and threads < 1:
        raise InputError(
            f"{threads} threads cannot work: give --threads 1 or more, or leave it out"
        )


def set_threads(threads: int | None = None) -> int:
    """Sets how many threads the parallel kernels use, and keeps OpenCV to the calling thread.

    Pictures are worked on side by side, so that threads within one would only wait for each other.
    Raises InputError for fewer than one.

    Args:
        threads: at least 1; None means all cores that numba detects.

    Returns:
        The number of threads in use.
    """
    available = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    check_threads(threads)
    threads = available if threads is None else threads
    numba.set_num_threads(min(threads, available))
    cv2.setNumThreads(1)
    return numba.get_num_threads()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keeps kernels to the calling thread: for work so small that waking others would cost more."""
    with _threads(1):
        yield


@contextmanager
def fewer_threads() -> Iterator[None]:
    """Keeps kernels of the calling thread off one core, for a thread that works beside it."""
    with _threads(max(numba.get_num_threads() - 1, 1)):
        yield


@contextmanager
def _threads(count: int) -> Iterator[None]:
    before = numba.get_num_threads()
    numba.set_num_threads(count)
    try:
        yield
    finally:
        numba.set_num_threads(before)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
