"""An object in a process of its own, whose interpreter it shares with nobody."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import get_context, parent_process
from typing import Any

from silhouette_core.jit import set_threads

_here: Any = None  # the object of this process, if it was begun for one


class OwnProcess:
    """An object in another process: threads of one would wait for each other's Python.

    Args:
        make: makes the object there; a function or class of a module.
        arguments: of `make`.
    """

    def __init__(self, make: Callable[..., Any], *arguments: object):
        """Begins the process, and returns at once."""
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), begin_process)
        self._made = self._pool.submit(_make, make, arguments)

    def wait(self) -> None:
        """Waits until the object is made; what that raises is raised here, and the process ends."""
        try:
            self._made.result()
        except BaseException:
            self._pool.shutdown(wait=False, cancel_futures=True)
            raise

    def call(self, method: str, *arguments: object) -> Any:
        """Result of one of the object's methods; what it raises there is raised here."""
        return self._pool.submit(_call, method, arguments).result()

    def close(self) -> None:
        """Calls the object's `close`, and ends the process."""
        with suppress(BrokenProcessPool):  # it has ended already
            self._pool.submit(_close).result()
        self._pool.shutdown(wait=True, cancel_futures=True)


def begin_process() -> None:
    """Keeps a process to one core, leaves interrupts to the one that began it, and ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Ends this process once the one that began it is gone, even if that was killed."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _make(make: Callable[..., Any], arguments: tuple[object, ...]) -> None:
    global _here
    _here = make(*arguments)


def _call(method: str, arguments: tuple[object, ...]) -> Any:
    return getattr(_here, method)(*arguments)


def _close() -> None:
    if _here is not None:
        _here.close()
