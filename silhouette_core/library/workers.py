"""Workers that share the tasks of a library build: this process, several, or other machines."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

from calib.errors import InputError
from silhouette_core.jit import set_threads

Task = TypeVar("Task")
Result = TypeVar("Result")


class Workers(Protocol):
    """Whoever carries out tasks."""

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """Carries out tasks, which depend on nothing but their arguments.

        Args:
            work: a function of a module, and tasks that can be pickled.
            tasks: the tasks.

        Returns:
            Numbers and results of the tasks, in the order in which they become ready.
        """
        ...


class OwnProcess:
    """Carries out one task after the other; each uses all threads."""

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """See `Workers.run`."""
        for number, task in enumerate(tasks):
            yield number, work(task)


class Processes:
    """Carries out tasks in several processes of one thread each.

    Args:
        pool: the processes.
        ahead: number of tasks handed out at a time, so that results do not pile up.
    """

    def __init__(self, pool: ProcessPoolExecutor, ahead: int):
        """Keeps the pool."""
        self._pool, self._ahead = pool, ahead

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """See `Workers.run`.

        Raises:
            InputError: a process ended before its task, usually for want of memory.
        """
        for first in range(0, len(tasks), self._ahead):
            some = tasks[first : first + self._ahead]
            try:
                yield from enumerate(self._pool.map(work, some), first)
            except BrokenProcessPool as error:
                raise InputError(
                    "a worker process was ended from outside, usually for want of memory: run the"
                    " command again with fewer --workers; finished views are kept"
                ) from error


class Cluster:
    """Carries out tasks on the machines of a Dask cluster.

    Args:
        client: a `distributed.Client`.
        ahead: number of tasks handed out at a time.
    """

    def __init__(self, client: Any, ahead: int):
        """Keeps the client."""
        self._client, self._ahead = client, ahead

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """See `Workers.run`."""
        for first in range(0, len(tasks), self._ahead):
            some = tasks[first : first + self._ahead]
            # pure=False: nothing is looked up by its content, which would be hashed first.
            waiting = self._client.map(work, some, pure=False)
            for number, future in enumerate(waiting, first):
                yield number, future.result()
                future.release()


@contextmanager
def open_workers(processes: int = 1, cluster: str | None = None) -> Iterator[Workers]:
    """Workers, for the length of a `with` block.

    Args:
        processes: number of processes on this machine; 1: this one.
        cluster: address of the scheduler of a Dask cluster, as in tcp://10.0.0.5:8786, on whose
            machines this program is installed; None: this machine alone.

    Raises:
        InputError: fewer than one process, Dask is not installed, or the cluster does not answer.
    """
    if processes < 1:
        raise InputError(f"{processes} workers do no work: give 1 or more")
    if cluster is not None:
        with _client(cluster) as client:
            yield Cluster(client, 2 * max(1, len(client.scheduler_info()["workers"])))
    elif processes == 1:
        yield OwnProcess()
    else:
        # Spawned, not forked: threads of numba and OpenCV do not survive a fork.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(processes, context, _one_thread) as pool:
            yield Processes(pool, 2 * processes)


def _client(address: str) -> Any:
    try:
        from distributed import Client  # type: ignore[import-not-found]
    except ImportError as error:
        raise InputError(
            "--cluster needs Dask, which is not installed: pip install 'voxelpose[cluster]'"
        ) from error
    try:
        return Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address}: {error}") from error


def _one_thread() -> None:
    """Keeps a worker process to one thread, numba's and those of BLAS."""
    os.environ["OMP_NUM_THREADS"] = "1"
    set_threads(1)
