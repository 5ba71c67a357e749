"""The one place that sets numba's options."""

import os

# Threads that wait for work sleep. Spinning ones would take the cores from video decoding, and from
# whatever else the machine runs.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba

# error_model "numpy": no hidden division checks. nogil: kernels may run beside video decoding.
# fastmath stays off, so that results are the same on every machine of one architecture and for
# every number of threads.
kernel = numba.njit(cache=True, nogil=True, error_model="numpy")
parallel_kernel = numba.njit(cache=True, nogil=True, error_model="numpy", parallel=True)
prange = numba.prange


def set_threads(threads: int | None = None) -> int:
    """Sets how many threads the parallel kernels use.

    Args:
        threads: at least 1; None means all cores that numba sees.

    Returns:
        The number in force.

    Raises:
        ValueError: fewer than one thread.
    """
    available = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
    wanted = available if threads is None else threads
    if wanted < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    numba.set_num_threads(min(wanted, available))
    return min(wanted, available)


def cores() -> int:
    """Returns how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
