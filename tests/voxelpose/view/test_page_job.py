"""A page's jobs, one at a time in a process of its own, others waiting."""

import os
import signal
import time

import pytest

from calib.errors import InputError
from voxelpose.view.serving.page_job import PageJob, StepError, Unfinished


def work(reporter, how, path):
    """Does what a test asks for, in the job's process."""
    reporter.stage("first", 4)
    for _ in range(4):
        reporter.advance()
    reporter.note("a note")
    reporter.stage("second", 2)
    if how == "wait":
        try:
            time.sleep(60)
        finally:
            path.unlink()  # what it had begun to write
    if how == "asked":
        reporter.tell(phase="waiting")
        reporter.picture("cam_1", b"old")
        reporter.picture("cam_1", b"new")
        while (word := reporter.asked()) is None:
            time.sleep(0.01)
        return {"result": word, "again": reporter.asked()}
    if how == "mistake":
        raise StepError("the file\nis not there", "import")
    if how == "bug":
        raise RuntimeError("a bug")
    if how == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"result": how}


@pytest.fixture
def job():
    job = PageJob()
    yield job
    job.close()


@pytest.fixture
def begin(job, tmp_path):
    """Begins a job; returns its state when it has ended, or its second stage has begun."""

    def begun(how, until="ended"):
        path = tmp_path / "partial"
        path.touch()
        job.start("fit", "walk", work, how, path, shares={"first": 1, "second": 3})
        return waited(job, until)

    return begun


def waited(job, until="ended"):
    end = time.monotonic() + 30
    while (state := job.status())["state"] == "running" and state["stage"] != until:
        assert time.monotonic() < end
        time.sleep(0.02)
    return state


def test_what_it_returns_is_kept_with_what_it_noted(job, begin):
    assert job.status() == {"state": "idle"}
    state = begin("done")
    assert (state["state"], state["result"], state["notes"]) == ("done", "done", ["a note"])
    assert job.status("fit", "walk") == state
    assert job.status("fit", "run") == job.status("export") == {"state": "idle"}


def test_one_at_a_time_whose_progress_is_told_and_which_can_be_stopped(job, begin, tmp_path):
    state = begin("wait", until="second")
    assert (state["part"], state["total"], state["notes"]) == (0.25, 2, ["a note"])
    assert state["left_s"] > 0
    with pytest.raises(InputError, match="the fit of walk is still running: wait for its end"):
        job.start("export", "run", work, "done", tmp_path)
    version = job.version
    job.stop()
    assert waited(job)["state"] == "stopped" and job.version > version
    assert not (tmp_path / "partial").exists()
    assert begin("done")["state"] == "done"


def test_it_tells_and_is_asked_while_it_runs(job, begin, tmp_path):
    job.ask("nobody listens")
    begin("asked", until="second")
    end = time.monotonic() + 30
    while job.status().get("phase") != "waiting" or job.picture("cam_1") != b"new":
        assert time.monotonic() < end
        time.sleep(0.02)
    assert job.picture("cam_2") is None
    job.ask("finish")
    state = waited(job)
    assert (state["state"], state["result"], state["again"]) == ("done", "finish", None)
    begin("done")
    assert job.picture("cam_1") is None and "phase" not in job.status()


@pytest.mark.parametrize(
    ("how", "error", "step"),
    [
        ("mistake", "the file is not there", "import"),
        ("bug", "a bug: the terminal shows its traceback", ""),
        ("killed", "the process was ended from outside, usually for want of memory", ""),
    ],
)
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_an_end_before_the_end_is_told_in_a_line(begin, capfd, how, error, step):
    state = begin(how)
    assert (state["state"], state["step"]) == ("failed", step) and state["error"].startswith(error)
    assert ("RuntimeError: a bug" in capfd.readouterr().err) == (how == "bug")


def test_others_wait_in_an_order_that_can_be_changed_and_each_can_be_taken_out(
    begin, job, tmp_path
):
    begin("asked", until="second")
    for of in "abc":
        job.start("export", of, work, of, tmp_path, asked={"of": of}, waits=True)
    with pytest.raises(InputError, match="still running"):
        job.start("recording", "walk", work, "done", tmp_path)
    numbers = {state["of"]: state["number"] for state in job.states()}
    job.put_before(numbers["c"], numbers["a"])
    job.put_before(numbers["b"], numbers["walk"])  # which runs already
    assert [state["of"] for state in job.states()] == ["walk", "c", "a", "b"]
    with pytest.raises(InputError, match="cannot be begun from here"):
        job.asked(numbers["a"])  # it will be, without that
    job.stop(numbers["a"])
    job.ask("finish")
    end = time.monotonic() + 60
    while {state["state"] for state in job.states()} != {"done"}:
        assert time.monotonic() < end
        time.sleep(0.02)
    assert [state["result"] for state in job.states()] == ["finish", "c", "b"]
    assert job.asked(numbers["c"]) == {"of": "c"}
    job.stop(numbers["c"])  # is shown no more
    assert [state["of"] for state in job.states()] == ["walk", "b"]


def test_jobs_that_the_end_of_the_program_interrupts_are_told(tmp_path):
    saved = []
    job = PageJob([Unfinished("fit", "old", None)], lambda unfinished: saved.append(unfinished))
    job.start("fit", "walk", work, "wait", tmp_path / "none", asked=1)
    job.start("fit", "run", work, "done", tmp_path, asked=2, waits=True)
    job.close()
    assert saved[-1] == [
        *(Unfinished("fit", "old", None), Unfinished("fit", "walk", 1), Unfinished("fit", "run", 2))
    ]
    later = PageJob(saved[-1])
    assert [(state["state"], state["repeatable"]) for state in later.states()] == [
        *(("interrupted", False), ("interrupted", True), ("interrupted", True))
    ]
    assert later.status() == {"state": "idle"}
