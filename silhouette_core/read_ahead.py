"""Work in several threads: on the next frames ahead of time, and on several things at once."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar, cast

import numba

from silhouette_core.jit import set_threads

_AHEAD = 3  # items that wait at most
_Given = TypeVar("_Given")
_Item = TypeVar("_Item")


def read_ahead(items: Iterator[_Item]) -> Iterator[_Item]:
    """The items of an iterator, the next few of which are made in a thread of their own.

    Items and their order stay the same. With one thread, or where numba's threads cannot be shared,
    every item is made when it is asked for.

    Args:
        items: an iterator, which nobody else reads.
    """
    if numba.get_num_threads() == 1 or not _shares_threads():
        return items
    return _made_in_a_thread(items)


def _made_in_a_thread(items: Iterator[_Item]) -> Iterator[_Item]:
    end = object()
    # One core is left to the caller.
    with ThreadPoolExecutor(1, "read ahead", set_threads, (1,)) as pool:
        waiting = deque(pool.submit(next, items, end) for _ in range(_AHEAD))
        try:
            while (item := waiting.popleft().result()) is not end:
                waiting.append(pool.submit(next, items, end))
                yield cast(_Item, item)
        finally:
            for item in waiting:
                item.cancel()


def side_by_side(function: Callable[[_Given], _Item], given: Sequence[_Given]) -> list[_Item]:
    """Results of a function for each of several things, as many at once as there are threads.

    Each is worked on by one thread, its kernels included. In the calling thread, one after the
    other, under the conditions of `read_ahead`.

    Args:
        function: may be called in any thread.
    """
    workers = min(numba.get_num_threads(), len(given))
    if workers < 2 or not _shares_threads():
        return [function(one) for one in given]
    with ThreadPoolExecutor(workers, "side by side", set_threads, (1,)) as pool:
        return list(pool.map(function, given))


def _shares_threads() -> bool:
    """Whether two threads may run parallel kernels at once: not with numba's simplest layer."""
    try:
        return numba.threading_layer() in ("omp", "tbb")  # type: ignore[attr-defined]
    except ValueError:  # no parallel kernel has run yet, and the layer is not chosen
        return False
