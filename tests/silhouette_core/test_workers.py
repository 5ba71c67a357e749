"""Workers in processes that are ended from outside."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from silhouette_core import workers
from silhouette_core.workers import WorkerEndedError, carry_out, interrupts_put_off


@pytest.fixture
def close_while_starting(monkeypatch):
    """A pool whose first process is ended while the second one is started, with an error."""

    class ClosingPool(Executor):
        def __init__(self, *_):
            self.futures = []

        def submit(self, work, task):
            if self.futures:
                raise self.error
            self.futures.append(Future())
            return self.futures[0]

    def close(error):
        ClosingPool.error = error
        monkeypatch.setattr(workers, "ProcessPoolExecutor", ClosingPool)

    return close


@pytest.mark.parametrize(
    "error", [OSError("handle is closed"), ValueError("bad value(s) in fds_to_keep")]
)
def test_a_process_that_ends_while_another_is_started_costs_its_task(close_while_starting, error):
    close_while_starting(error)
    with pytest.raises(WorkerEndedError) as ended:
        list(carry_out(str, [1, 2, 3], 2))
    assert ended.value.tasks == (0,)


def test_a_process_that_cannot_be_started_is_another_error(close_while_starting):
    close_while_starting(OSError(11, "Resource temporarily unavailable"))
    with pytest.raises(OSError, match="temporarily"):
        list(carry_out(str, [1, 2], 2))


def test_a_task_with_which_machines_of_a_cluster_are_lost_is_to_blame(monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")

    class Losing(Executor):
        def submit(self, work, task):
            lost = Future()
            lost.set_exception(distributed.KilledWorker("task", None, 3))
            return lost

    client = MagicMock()
    client.__enter__.return_value = client
    client.get_executor.return_value, client.nthreads.return_value = Losing(), {"one": 1}
    monkeypatch.setattr(workers, "_client", lambda address: client)
    with pytest.raises(WorkerEndedError) as ended:
        list(carry_out(str, [1, 2], 1, "tcp://127.0.0.1:8786"))
    assert ended.value.tasks == (0,)


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


def deaf(flag):
    """Ignores SIGTERM, like a process that had not begun when it came."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    flag.touch()
    time.sleep(60)


def ended_once_busy(flag):
    while not flag.exists():
        time.sleep(0.02)
    os.kill(os.getpid(), signal.SIGKILL)


def met(folder, number):
    """Returns once the other process has met it."""
    (folder / f"{number}").touch()
    while len(list(folder.iterdir())) < 2:
        time.sleep(0.02)


def run(task):
    work, *arguments = task
    return work(*arguments)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")
def test_no_process_that_misses_the_pools_signal_is_waited_for(tmp_path):
    flag, folder = tmp_path / "busy", tmp_path / "met"
    folder.mkdir()
    # CPython's pool watches the second process only from the first result on.
    first = [(met, folder, 0), (met, folder, 1)]
    results = carry_out(run, [*first, (ended_once_busy, flag), (deaf, flag)], 2)
    assert next(results)[0] in (0, 1) and next(results)[0] in (0, 1)
    started = time.monotonic()
    with pytest.raises(WorkerEndedError):
        list(results)
    assert time.monotonic() - started < 45  # the other one sleeps for a minute


SCRIPT = """
from silhouette_core.workers import carry_out
print("begun", flush=True)
print(sorted(carry_out(abs, [-1, -2, -3], 2)))
"""


def test_a_script_without_a_main_guard_is_not_run_again(tmp_path):
    (tmp_path / "plain.py").write_text(SCRIPT)
    root = Path(__file__).resolve().parents[2]
    ended = subprocess.run(
        [sys.executable, tmp_path / "plain.py"],
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.stdout == "begun\n[(0, 1), (1, 2), (2, 3)]\n", ended.stderr
    assert (ended.returncode, ended.stderr) == (0, "")
