"""Long jobs of a page, one at a time, in a process of its own: with its progress, what it is asked
meanwhile, and ended at once where somebody stops it.
"""

import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from multiprocessing.connection import Connection
from typing import Any

import msgspec

from calib.errors import InputError
from silhouette_core.progress import OverallProgress
from silhouette_core.workers import Child
from voxelpose.view.serving.gate import Reply
from voxelpose.view.serving.page_answers import event_stream
from voxelpose.view.serving.page_words import field_at_fault

_STOP_S = 8  # after which a process that does not end is killed
_TELL_EVERY_MS = 100
_LOOK_MS = 200  # between looks at the jobs
_SURE_PERCENT = 4  # of the work from which the time that is left is told
_KEPT = 50  # notes of a job, and jobs that have ended
_ENDED_STATES = "done", "failed", "stopped"
_NOT_BEGUN = "waiting", "interrupted"
_BEGINNING = "loading the program"
_BUG = "a bug: the terminal shows its traceback; the page goes on"
_ENDED = (
    "the process was ended from outside, usually for want of memory: close other programs, or take"
    " fewer frames"
)


class StepError(InputError):
    """An error of a job, and the step of the page that mends it."""

    def __init__(self, line: str, step: str) -> None:
        super().__init__(line)
        self.step = step


@dataclass(eq=False)
class _Job:
    """What is to be done, and what pages are told of it."""

    work: Callable[..., Any]
    arguments: tuple[object, ...]
    step: str
    overall: OverallProgress | None
    asked: Any
    state: dict[str, Any]
    started_s: float = 0.0
    stopping: bool = False


@dataclass(frozen=True)
class Unfinished:
    """A job that has not ended: its kind, what it is done to, and what was asked for."""

    kind: str
    of: str
    asked: Any


class PageJob:
    """Runs one job at a time, others wait for their turn; what came of them stays until the same is
    begun once more. Any thread may use it.

    Attributes:
        version: a number that changes whenever a state does.
    """

    def __init__(
        self,
        interrupted: Iterable[Unfinished] = (),
        keep: Callable[[Sequence[Unfinished]], None] = lambda unfinished: None,
    ) -> None:
        """Names the jobs that an earlier end of the program has interrupted; `keep` is called with
        all that have not ended, whenever these change.
        """
        self._lock = threading.RLock()
        self._child: Child | None = None
        self._pictures: dict[str, bytes] = {}
        self._thread: threading.Thread | None = None
        self._jobs: list[_Job] = []  # ended ones, the one that runs, those that wait, in order
        self._numbers = count(1)
        self._closing, self._keep = False, keep
        self.version = 0
        for job in interrupted:
            self._add(_Job(_run, (), "", None, job.asked, {"kind": job.kind, "of": job.of}))

    def start(
        self,
        kind: str,
        of: str,
        work: Callable[..., Mapping[str, Any]],
        *arguments: object,
        shares: Mapping[str, float] | None = None,
        step: str = "",
        asked: Any = None,
        waits: bool = False,
        project: str = "",
    ) -> None:
        """Begins a job, or lets it wait for those before it. InputError where another one is
        running, and it may not wait.

        Args:
            kind: what it does, such as "fit".
            of: what it is done to: a recording, a result.
            work: a function of a module that takes a JobReporter and the arguments, all of which
                can be pickled, and returns what is known then; its InputError is told in a line.
            shares: of the time that its stages usually take; None: not known.
            step: of the page that mends an InputError which is no StepError.
            asked: what it can be begun from once more; None: it cannot.
            waits: whether it may wait.
            project: of what it is done to, where that is none itself.
        """
        with self._lock:
            running = self._running()
            if running is not None and not waits:
                raise InputError(
                    f"the {running.state['kind']} of {running.state['of']} is still running: wait"
                    " for its end, or stop it"
                )
            ended = [job for job in self._jobs if job.state["state"] in _ENDED_STATES]
            same = [job for job in ended if (job.state["kind"], job.state["of"]) == (kind, of)]
            for job in {*same, *ended[:-_KEPT]}:
                self._jobs.remove(job)
            overall = None if shares is None else OverallProgress(shares)
            state = {"state": "waiting", "kind": kind, "of": of, "project": project or of}
            self._add(_Job(work, arguments, step, overall, asked, state))
            self._begin_next()

    def status(self, kind: str | None = None, of: str | None = None) -> dict[str, Any]:
        """State of the job that runs, or ended last, of those of a kind, and done to something:
        running (stage, done, total, part, left_s, notes, and what the job tells), failed (error,
        the field at fault, the step that mends it), stopped, or done (with what the work returned);
        idle where there is none.
        """
        with self._lock:
            begun = [job.state for job in self._jobs if job.state["state"] not in _NOT_BEGUN]
            same_kind = [state for state in begun if kind in (None, state["kind"])]
            wanted = [state for state in same_kind if of in (None, state["of"])]
            return dict(wanted[-1]) if wanted else {"state": "idle"}

    def states(self) -> list[dict[str, Any]]:
        """States of all jobs, each with its number: those that have ended, the one that runs, and
        those that wait for it ("waiting"). "interrupted": by an earlier end of the program.
        `into`: the folder that is asked for, or "".
        """
        with self._lock:
            return [dict(job.state) for job in self._jobs]

    def events(self) -> Reply:
        """A stream of the numbers of all jobs in their `order`, and the states that `changed`."""

        def changes() -> Iterator[dict[str, Any] | None]:
            sent_version, sent = -1, dict[int, dict[str, Any]]()
            while True:
                version = self.version
                if version == sent_version:
                    yield None
                    continue
                states = {state["number"]: state for state in self.states()}
                changed = [state for number, state in states.items() if state != sent.get(number)]
                yield {"order": list(states), "changed": changed}
                sent_version, sent = version, states

        return event_stream(changes(), _LOOK_MS)

    def unfinished(self) -> list[Unfinished]:
        """The jobs that have not ended, interrupted ones too."""
        with self._lock:
            left = [job for job in self._jobs if job.state["state"] not in _ENDED_STATES]
            return [Unfinished(job.state["kind"], job.state["of"], job.asked) for job in left]

    def picture(self, name: str) -> bytes | None:
        """The newest picture of a name that the job has sent; None where there is none."""
        with self._lock:
            return self._pictures.get(name)

    def ask(self, word: str) -> None:
        """Asks something of the job that is running, which looks for it in its own time."""
        with self._lock:
            if self._running() is not None and self._child is not None:
                with suppress(OSError):  # it ends just now
                    self._child.pipe.send(word)

    def stop(self, number: int | None = None) -> None:
        """Ends the job that is running, of which nothing is left that it had not finished; by its
        number one that waits, or has ended, too, which is forgotten.
        """
        with self._lock:
            job = self._running() if number is None else self._job(number)
            if job is not None and job.state["state"] == "running" and self._child is not None:
                job.stopping, child = True, self._child
                child.terminate()
                threading.Thread(target=child.end, args=(_STOP_S,), daemon=True).start()
            elif job is not None:
                self._jobs.remove(job)
                self._changed()

    def asked(self, number: int) -> Any:
        """What a job can be begun from once more. InputError where it cannot."""
        with self._lock:
            job = self._job(number)
            if job is None or job.asked is None or job.state["state"] in ("waiting", "running"):
                raise InputError("this job cannot be begun from here: begin it in its own step")
            return job.asked

    def put_before(self, number: int, other: int) -> None:
        """Lets a job that waits take the place of another one, which comes after it."""
        with self._lock:
            job, place = self._job(number), self._job(other)
            if job and place and job.state["state"] == place.state["state"] == "waiting":
                self._jobs.remove(job)
                self._jobs.insert(self._jobs.index(place), job)
                self._changed()

    def close(self) -> None:
        """Ends the job that is running, and waits for that; those that wait do not begin."""
        with self._lock:
            self._closing = True
            self.stop()
        if self._thread is not None:
            self._thread.join(_STOP_S + 2)

    def _job(self, number: int) -> _Job | None:
        return next((job for job in self._jobs if job.state["number"] == number), None)

    def _running(self) -> _Job | None:
        return next((job for job in self._jobs if job.state["state"] == "running"), None)

    def _add(self, job: _Job) -> None:
        job.state = {"state": "interrupted", "project": job.state["of"]} | job.state
        job.state |= {"number": next(self._numbers), "repeatable": job.asked is not None}
        asked = msgspec.to_builtins(job.asked)
        job.state["into"] = asked.get("out", "") if isinstance(asked, dict) else ""
        self._jobs.append(job)

    def _changed(self) -> None:
        """Tells which jobs have not ended."""
        self.version += 1
        self._keep(self.unfinished())

    def _begin_next(self) -> None:
        """Begins the first job that waits, if none is running."""
        waiting = [job for job in self._jobs if job.state["state"] == "waiting"]
        if waiting and self._running() is None and not self._closing:
            job = waiting[0]
            self._child, self._pictures = Child(_run, job.work, job.arguments), {}
            job.started_s = time.monotonic()
            job.state |= {"state": "running", "notes": [], "stage": _BEGINNING, "done": 0}
            job.state |= {"total": None, "part": None}
            self._thread = threading.Thread(
                target=self._listen, args=(job, self._child), name="job of the page", daemon=True
            )
            self._thread.start()
        self._changed()

    def _listen(self, job: _Job, child: Child) -> None:
        kind = "at"
        while kind not in ("done", "failed"):
            content: Any = (_ENDED, "")
            try:
                kind, content = child.pipe.recv()
            except (EOFError, OSError):
                kind = "failed"
            if kind in ("done", "failed"):
                child.wait(_STOP_S)  # its files are all there, or gone
            with self._lock:
                job.state |= self._told(job, kind, content)
                self.version += 1
        child.pipe.close()
        with self._lock:
            self._begin_next()

    def _told(self, job: _Job, kind: str, content: Any) -> Mapping[str, Any]:
        """What a job's state becomes by what its process has sent."""
        if kind == "at":
            stage, done, total = content
            part = None if job.overall is None else job.overall.part(stage, done, total)
            elapsed_s = time.monotonic() - job.started_s
            known = part is not None and 100 * part > _SURE_PERCENT
            left_s = elapsed_s * (1 - part) / part if known and part else None
            return {"stage": stage, "done": done, "total": total, "part": part, "left_s": left_s}
        if kind == "note":
            return {"notes": [*job.state["notes"], content][-_KEPT:]}
        if kind == "picture":
            name, picture = content
            self._pictures[name] = picture
            return {}
        if kind == "tell":
            return content
        if kind == "done":
            return {"state": "done", **content}
        if job.stopping:
            return {"state": "interrupted" if self._closing else "stopped"}
        error, step = content
        step, field = job.step if step is None else step, field_at_fault(error)
        return {"state": "failed", "error": error, "step": step, "field": field}


class JobReporter:
    """Tells progress, and whatever else the page shows, to the process that has begun this one."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._lock, self._told_s = pipe, threading.Lock(), 0.0
        self._stage, self._done, self._total = _BEGINNING, 0, None

    def stage(self, name: str, total: int | None = None) -> None:
        """See `Reporter.stage`."""
        self._stage, self._done, self._total = name, 0, total
        self._send_progress()

    def advance(self, steps: int = 1) -> None:
        """See `Reporter.advance`."""
        self._done += steps
        if 1000 * (time.monotonic() - self._told_s) > _TELL_EVERY_MS:
            self._send_progress()

    def note(self, text: str) -> None:
        """See `Reporter.note`."""
        self.send("note", text)

    def tell(self, **known: Any) -> None:
        """Adds what is known to the job's state."""
        self.send("tell", known)

    def picture(self, name: str, content: bytes) -> None:
        """Sends a picture that takes the place of the one before of the same name."""
        self.send("picture", (name, content))

    def asked(self) -> str | None:
        """What was asked since this was called last; None: nothing."""
        return self._pipe.recv() if self._pipe.poll() else None

    def send(self, kind: str, content: Any) -> None:
        """Sends whatever it is, one thread after the other."""
        with self._lock:
            self._pipe.send((kind, content))

    def _send_progress(self) -> None:
        self._told_s = time.monotonic()
        self.send("at", (self._stage, self._done, self._total))


def _run(pipe: Connection, work: Callable[..., Any], arguments: tuple[object, ...]) -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    reporter = JobReporter(pipe)
    try:
        outcome, content = "done", work(reporter, *arguments)
    except InputError as error:
        outcome, content = "failed", (" ".join(str(error).split()), getattr(error, "step", None))
    except KeyboardInterrupt:
        outcome, content = "failed", (_ENDED, "")
    except OSError as error:
        traceback.print_exc()
        line = f"{error.filename or 'a file'}: {error.strerror or error}"
        outcome, content = "failed", (line, "")
    except Exception:
        traceback.print_exc()
        outcome, content = "failed", (_BUG, "")
    reporter.send(outcome, content)
