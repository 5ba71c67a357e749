"""Estimation in a process of its own, whose interpreter it shares with nobody."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from multiprocessing import get_context, parent_process
from typing import TYPE_CHECKING, Any, Protocol

from silhouette_core.jit import set_threads

if TYPE_CHECKING:
    from silhouette_core.body.model import BodyModel
    from voxelpose.live.live_estimators import FoundPose

_here: PoseFinder | None = None  # of this process, if it was begun for one
_last: BodyModel | None = None  # that the process which began this one knows already


class PoseFinder(Protocol):
    """Finds the person in one moment after the other."""

    def step(self, given: Any, /) -> FoundPose | None:
        """The person; None where there is none."""
        ...

    def close(self) -> None:
        """Ends what was begun."""
        ...


class EstimatorProcess:
    """What finds poses, in another process: threads of one would wait for each other's Python.

    Args:
        make: makes a `PoseFinder` there; a function or class of a module.
        arguments: of `make`.

    Raises:
        InputError: as `make` raises it.
    """

    def __init__(self, make: Callable[..., PoseFinder], *arguments: object):
        """Begins the process, and waits until it is ready."""
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), begin_process)
        self._model: BodyModel | None = None
        try:
            self._pool.submit(_make, make, arguments).result()
        except BaseException:
            self._pool.shutdown(wait=False, cancel_futures=True)
            raise

    def step(self, given: object) -> FoundPose | None:
        """See `PoseFinder.step`; what it raises there is raised here."""
        found = self._pool.submit(_step, given).result()
        if found is None:
            return None
        self._model = found.model or self._model
        return replace(found, model=self._model)

    def close(self) -> None:
        """Ends the process."""
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


def _make(make: Callable[..., PoseFinder], arguments: tuple[object, ...]) -> None:
    global _here
    _here = make(*arguments)


def _step(given: object) -> FoundPose | None:
    global _last
    assert _here is not None
    found = _here.step(given)
    if found is None:
        return None
    known, _last = found.model is _last, found.model
    # A body is large: it is sent when it has changed.
    return replace(found, model=None) if known else found  # type: ignore[arg-type]


def _close() -> None:
    if _here is not None:
        _here.close()
