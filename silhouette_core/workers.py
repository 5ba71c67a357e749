"""Workers that share independent tasks: this process, several processes, or other machines."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, Protocol, TypeVar

from calib.errors import InputError
from silhouette_core.jit import set_threads

Task = TypeVar("Task")
Result = TypeVar("Result")


class _ProcessWithoutMain(SpawnProcess):
    """Process that does not run the main script again, which may have no `if __name__ ==
    "__main__"` and would begin processes without end: what processes do here is in modules.
    """

    def start(self) -> None:
        """Begins the process."""
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")
        try:
            super().start()
        finally:
            sys.modules["__main__"] = main


class _Spawn(SpawnContext):
    Process = _ProcessWithoutMain


SPAWN = _Spawn()  #: How processes begin: threads of numba and OpenCV do not survive a fork.


class WorkerEndedError(InputError):
    """A worker was ended from outside before its task, usually for want of memory.

    Attributes:
        tasks: numbers of the tasks that were in work, of which one is to blame.
    """

    def __init__(self, tasks: Iterable[int]):
        super().__init__(
            "a worker process was ended from outside, usually for want of memory: run the command"
            " again with fewer of them; what was finished is kept"
        )
        self.tasks = tuple(tasks)


class Workers(Protocol):
    """Whoever carries out tasks."""

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """Carries out tasks, which depend on nothing but their arguments.

        Args:
            work: a function of a module, and tasks that can be pickled.

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
        ahead: number of tasks handed out at a time, so that results do not pile up.
    """

    def __init__(self, pool: ProcessPoolExecutor, ahead: int):
        self._pool, self._ahead = pool, ahead

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """See `Workers.run`.

        Raises:
            WorkerEndedError: a process was ended before its task.
        """
        todo, waiting = iter(enumerate(tasks)), {}
        try:
            while True:
                for number, task in islice(todo, self._ahead - len(waiting)):
                    waiting[self._submitted(work, task)] = number
                if not waiting:
                    return
                ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
                for future in ready:
                    result = future.result()
                    yield waiting.pop(future), result
        except BrokenProcessPool as error:
            raise WorkerEndedError(waiting.values()) from error
        finally:
            for future in waiting:
                future.cancel()

    def _submitted(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        """A task handed to the pool.

        Raises:
            BrokenProcessPool: a process was ended.
        """
        try:
            with interrupts_put_off():
                return self._pool.submit(work, task)
        except (OSError, ValueError) as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise
            # The pool closed its pipes while it started another process for this task: they have
            # no handle any more, or one that another file has by now.
            raise BrokenProcessPool("a process was ended while another one was started") from error


class Cluster:
    """Carries out tasks on the machines of a Dask cluster.

    Args:
        client: a `distributed.Client`.
        ahead: number of tasks handed out at a time.
    """

    def __init__(self, client: Any, ahead: int):
        self._client, self._ahead = client, ahead

    def run(
        self, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[tuple[int, Result]]:
        """See `Workers.run`. A task whose machine is lost is given to another one.

        Raises:
            WorkerEndedError: several machines were lost with the same task.
        """
        from distributed import (  # type: ignore[import-not-found]
            KilledWorker,
            as_completed,
        )

        todo, numbers = iter(enumerate(tasks)), {}

        def submitted(count: int) -> list[Any]:
            # pure=False: nothing is looked up by its content, which would be hashed first.
            some = list(islice(todo, count))
            futures = self._client.map(work, [task for _, task in some], pure=False)
            numbers.update(zip((f.key for f in futures), (n for n, _ in some), strict=True))
            return futures

        waiting = as_completed(submitted(self._ahead))
        for future in waiting:
            number = numbers.pop(future.key)
            try:
                yield number, future.result()
            except KilledWorker as error:
                raise WorkerEndedError([number]) from error
            future.release()
            for further in submitted(1):
                waiting.add(further)


@contextmanager
def open_workers(
    processes: int = 1, cluster: str | None = None, ahead: int = 2, apart: bool = False
) -> Iterator[Workers]:
    """Workers, for the length of a `with` block.

    Args:
        processes: number of processes on this machine; 1: this one.
        cluster: address of the scheduler of a Dask cluster, as in tcp://10.0.0.5:8786, on whose
            machines this program is installed; None: this machine alone.
        ahead: number of tasks handed out to each worker at a time.
        apart: whether a single process, too, is another one than this: it may use all threads, and
            its end does not end this one.

    Raises:
        InputError: fewer than one process, Dask is not installed, or the cluster does not answer.
    """
    if processes < 1:
        raise InputError(f"{processes} workers do no work: give 1 or more")
    if cluster is not None:
        with _client(cluster) as client:
            yield Cluster(client, ahead * max(1, len(client.scheduler_info()["workers"])))
    elif processes == 1 and not apart:
        yield OwnProcess()
    else:
        prepare = None if processes == 1 else _one_thread
        others = set(multiprocessing.active_children())
        with ProcessPoolExecutor(processes, SPAWN, prepare) as pool:
            try:
                yield Processes(pool, ahead * processes)
            except WorkerEndedError:
                # A process that was just starting may miss the pool's SIGTERM, and would be waited
                # for without end.
                for process in set(multiprocessing.active_children()) - others:
                    process.kill()
                raise


@contextmanager
def interrupts_put_off() -> Iterator[None]:
    """Puts off SIGINT and SIGTERM for the length of a `with` block that begins a process, which
    would otherwise read half of what it is to do, and end with a traceback of its own.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are handled in the main thread alone
        return
    caught: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.signal(number, lambda one, _: caught.append(one)) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)
        for number in caught:
            signal.raise_signal(number)


def end_with_parent() -> None:
    """Ends this process once its parent is gone, even if killed; for a thread of its own."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


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
