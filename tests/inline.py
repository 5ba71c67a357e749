"""Executor that does every job at once, so that tests do not depend on how fast a machine is."""

from concurrent.futures import Executor, Future


class Inline(Executor):
    """Runs what is submitted before it returns."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        future.set_result(fn(*args, **kwargs))
        return future
