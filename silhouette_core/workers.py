"""Other processes: those that share independent tasks, on this machine or others, and a single one
that is spoken to.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.util import Finalize
from types import ModuleType
from typing import Any, TypeVar

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


def carry_out(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    processes: int,
    cluster: str | None = None,
) -> Generator[tuple[int, Result]]:
    """Carries out tasks, which depend on nothing but their arguments, in processes of this machine,
    or on others: one process uses all threads, several use one each.

    Args:
        work: a function of a module, and tasks that can be pickled.
        processes: how many there are on this machine; where there is one, it is another than this,
            too, so that its end does not end this one.
        cluster: address of the scheduler of a Dask cluster, as in tcp://10.0.0.5:8786, on whose
            machines this program is installed; None: this machine alone.

    Yields:
        Numbers and results of the tasks, in the order in which they become ready.

    Raises:
        WorkerEndedError: a process was ended before its task, or several machines were lost with
            the same one.
        InputError: fewer than one process, Dask is not installed, or the cluster does not answer.
    """
    if processes < 1:
        raise InputError(f"{processes} workers do no work: give 1 or more")
    todo, waiting = iter(enumerate(tasks)), dict[Future[Result], int]()
    try:
        with _open_pool(processes, cluster) as (pool, ahead):
            try:
                while True:
                    # As many as there are workers, so that few are to blame for the end of one.
                    for number, task in islice(todo, ahead - len(waiting)):
                        waiting[_submitted(pool, work, task)] = number
                    if not waiting:
                        return
                    ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
                    for future in ready:
                        result = future.result()
                        yield waiting.pop(future), result
            finally:
                for future in waiting:
                    future.cancel()
    except BrokenExecutor as error:
        raise WorkerEndedError(waiting.values()) from error


@contextmanager
def _open_pool(processes: int, cluster: str | None) -> Iterator[tuple[Executor, int]]:
    """A pool and the number of its workers; BrokenExecutor where one was ended."""
    if cluster is not None:
        with _client(cluster) as client:
            from distributed import KilledWorker  # type: ignore[import-not-found]

            try:
                # pure=False: nothing is looked up by its content, which would be hashed first.
                with client.get_executor(pure=False) as pool:
                    yield pool, max(1, len(client.nthreads()))
            except KilledWorker as error:
                raise BrokenExecutor("machines were lost") from error
        return
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(processes, SPAWN, None if processes == 1 else _one_thread) as pool:
        try:
            yield pool, processes
        except BrokenExecutor:
            # A process that was just starting may miss the pool's SIGTERM, and would be waited for
            # without end.
            for process in set(multiprocessing.active_children()) - others:
                process.kill()
            raise


def _submitted(pool: Executor, work: Callable[[Task], Result], task: Task) -> Future[Result]:
    """A task handed to a pool.

    Raises:
        BrokenProcessPool: a process was ended.
    """
    try:
        with interrupts_put_off():
            return pool.submit(work, task)
    except (OSError, ValueError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        # The pool closed its pipes while it started another process for this task: they have no
        # handle any more, or one that another file has by now.
        raise BrokenProcessPool("a process was ended while another one was started") from error


class Child:
    """A process of its own that serves one end of a pipe, `serve(pipe, *arguments)` of a module:
    interrupts are left to this process, with which it ends.

    Attributes:
        pipe: the other end.
    """

    def __init__(self, serve: Callable[..., object], *arguments: object) -> None:
        self.pipe, child_end = SPAWN.Pipe()
        self._process = SPAWN.Process(target=_serve, args=(serve, child_end, *arguments))
        with interrupts_put_off():
            self._process.start()
        child_end.close()
        # At the program's end, before it waits for its processes.
        Finalize(self, self.pipe.close, exitpriority=0)

    def terminate(self) -> None:
        """Asks it to end, by SIGTERM."""
        self._process.terminate()

    def wait(self, timeout_s: float) -> bool:
        """Whether it has ended, at most so many seconds from now."""
        self._process.join(timeout_s)
        return not self._process.is_alive()

    def end(self, timeout_s: float) -> None:
        """Waits for its end, and kills it after so many seconds."""
        if not self.wait(timeout_s):
            self._process.kill()
            self._process.join()


def _serve(serve: Callable[..., object], pipe: Connection, *arguments: object) -> None:
    leave_interrupts()
    serve(pipe, *arguments)


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


def leave_interrupts(threads: int | None = None) -> None:
    """Leaves interrupts to the process that began this one, and ends it once that is gone, even if
    killed; keeps it to so many threads, None: as many as there are.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if threads is not None:
        set_threads(threads)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
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
