"""An object in a process of its own, whose interpreter it shares with nobody."""

import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from silhouette_core.jit import set_threads
from silhouette_core.workers import Child

_CLOSE_S = 10  # after which a process that does not end is killed


class RemoteObject:
    """An object, as a module's function or class makes it, in another process: threads of one would
    wait for each other's Python.

    A pipe rather than an executor: that one has threads of its own on the way, which take turns
    with the session's.
    """

    def __init__(self, make: Callable[..., Any], *arguments: object):
        self._child, self._made = Child(_serve, make, arguments), False

    def wait(self) -> None:
        """Waits until the object is made; what that raises is raised here, and the process ends."""
        if self._made:
            return
        try:
            self._receive()
        except BaseException:
            self._end()
            raise
        self._made = True

    def call(self, method: str, *arguments: object) -> Any:
        """Result of one of the object's methods, or what it raised; one thread calls at a time.
        RuntimeError where the process has ended.
        """
        self.wait()
        try:
            self._child.pipe.send((method, arguments))
        except OSError as error:
            raise _ended() from error
        return self._receive()

    def close(self) -> None:
        """Calls the object's `close`, and ends the process."""
        try:
            with suppress(RuntimeError):  # it has ended already
                self.call("close")
        finally:
            self._end()

    def _receive(self) -> Any:
        try:
            result, error, trace = self._child.pipe.recv()
        except (EOFError, OSError) as lost:
            raise _ended() from lost
        if error is not None:
            error.add_note(trace)
            raise error
        return result

    def _end(self) -> None:
        self._child.pipe.close()  # which ends what serves it
        self._child.end(_CLOSE_S)


def _ended() -> RuntimeError:
    return RuntimeError("a process of the live session has ended")


def _serve(pipe: Connection, make: Callable[..., Any], arguments: tuple[object, ...]) -> None:
    """Makes the object, and calls its methods until the other end is closed."""
    set_threads(1)
    made = _answer(pipe, make, arguments, keep=True)
    while made is not None:
        try:
            method, given = pipe.recv()
        except (EOFError, OSError):
            return
        _answer(pipe, getattr(made, method), given)


def _answer(
    pipe: Connection, work: Callable[..., Any], given: tuple[object, ...], keep: bool = False
) -> Any:
    """Sends what a call returns or raises; returns it, too, and does not send it, if it is kept."""
    result, error, trace = None, None, ""
    try:
        result = work(*given)
    except BaseException as raised:
        error, trace = raised, traceback.format_exc()
    pipe.send((None if keep else result, error, trace))
    return result
