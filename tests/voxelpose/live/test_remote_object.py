import os
import signal
import time

import pytest

from calib.errors import InputError
from voxelpose.live.remote_object import RemoteObject


class Counter:
    """Object of the other process."""

    def __init__(self, first: int):
        if first < 0:
            raise InputError("no negative numbers")
        self.count = first

    def add(self, more: int) -> tuple[int, int]:
        self.count += more
        return self.count, os.getpid()

    def fail(self) -> None:
        raise ZeroDivisionError("on purpose")

    def close(self) -> None: ...


def test_the_object_lives_elsewhere_and_keeps_its_state():
    process = RemoteObject(Counter, 3)
    assert process.call("add", 4)[0] == 7
    count, place = process.call("add", 1)
    assert count == 8
    assert place != os.getpid()
    process.close()
    with pytest.raises(OSError):
        os.kill(place, 0)


def test_what_is_raised_there_is_raised_here_with_its_traceback():
    process = RemoteObject(Counter, 0)
    with pytest.raises(ZeroDivisionError, match="on purpose") as caught:
        process.call("fail")
    assert "in fail" in "".join(caught.value.__notes__)
    assert process.call("add", 1)[0] == 1
    process.close()


def test_what_making_it_raises_is_raised_by_wait():
    with pytest.raises(InputError, match="no negative numbers"):
        RemoteObject(Counter, -1).wait()


def test_a_process_that_was_killed_is_an_error_and_can_be_closed():
    process = RemoteObject(Counter, 0)
    _, place = process.call("add", 0)
    os.kill(place, signal.SIGKILL)
    time.sleep(0.1)
    with pytest.raises(RuntimeError, match="has ended"):
        process.call("add", 1)
    process.close()
