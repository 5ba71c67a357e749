"""Work on the next frames in a second thread while the present one is estimated."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar, cast

import numba

from silhouette_core.jit import set_threads

_Item = TypeVar("_Item")


def read_ahead(items: Iterator[_Item], ahead: int = 3) -> Iterator[_Item]:
    """The items of an iterator, the next few of which are made in a thread of their own.

    Items and their order stay the same. With one thread, or where numba's threads cannot be shared,
    every item is made when it is asked for.

    Args:
        items: an iterator, which nobody else reads.
        ahead: number of items that wait at most. With 1, an item is begun when the one before it
            is handed out, and all before that have been dealt with.
    """
    if numba.get_num_threads() == 1 or not _shares_threads():
        return items
    return _made_in_a_thread(items, ahead)


def _made_in_a_thread(items: Iterator[_Item], ahead: int) -> Iterator[_Item]:
    end = object()
    # One core is left to the caller.
    with ThreadPoolExecutor(1, "read ahead", set_threads, (1,)) as pool:
        waiting = deque(pool.submit(next, items, end) for _ in range(ahead))
        try:
            while (item := waiting.popleft().result()) is not end:
                waiting.append(pool.submit(next, items, end))
                yield cast(_Item, item)
        finally:
            for item in waiting:
                item.cancel()


def _shares_threads() -> bool:
    """Whether two threads may run parallel kernels at once: not with numba's simplest layer."""
    try:
        return numba.threading_layer() in ("omp", "tbb")  # type: ignore[attr-defined]
    except ValueError:  # no parallel kernel has run yet, and the layer is not chosen
        return False
