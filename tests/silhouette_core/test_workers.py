"""Workers in processes that are ended from outside."""

import signal
from concurrent.futures import Future

import pytest

from silhouette_core.workers import Processes, WorkerEndedError, interrupts_put_off


class ClosingPool:
    """A pool whose first process is ended while the second one is started."""

    def __init__(self, error: OSError):
        self.error, self.futures = error, []

    def submit(self, work, task):
        if self.futures:
            raise self.error
        self.futures.append(Future())
        return self.futures[0]


def test_a_process_that_ends_while_another_is_started_costs_its_task():
    with pytest.raises(WorkerEndedError) as ended:
        list(Processes(ClosingPool(OSError("handle is closed")), 2).run(str, [1, 2, 3]))  # type: ignore[arg-type]
    assert ended.value.tasks == (0,)


def test_a_process_that_cannot_be_started_is_another_error():
    pool = ClosingPool(OSError(11, "Resource temporarily unavailable"))
    with pytest.raises(OSError, match="temporarily"):
        list(Processes(pool, 2).run(str, [1, 2]))  # type: ignore[arg-type]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_waits_until_a_process_has_begun(number):
    done = []

    def interrupt(one, frame):
        raise KeyboardInterrupt

    before = signal.signal(number, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt), interrupts_put_off():
            signal.raise_signal(number)
            done.append("begun")
        assert done == ["begun"]
        assert signal.getsignal(number) is interrupt
    finally:
        signal.signal(number, before)
