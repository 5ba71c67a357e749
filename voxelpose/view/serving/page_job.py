"""One long job of a page at a time, in a process of its own: with its progress, what it is asked
meanwhile, and ended at once where somebody stops it.
"""

import signal
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from calib.errors import InputError
from silhouette_core.progress import OverallProgress
from silhouette_core.workers import Child
from voxelpose.view.serving.page_words import field_at_fault

_STOP_S = 8  # after which a process that does not end is killed
_TELL_EVERY_MS = 100
_SURE_PERCENT = 4  # of the work from which the time that is left is told
_MOST_NOTES = 50
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


class PageJob:
    """Runs at most one job; what came of it stays until the next. Any thread may use it.

    Attributes:
        version: a number that changes whenever the status does.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._child: Child | None = None
        self._pictures: dict[str, bytes] = {}
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._state: dict[str, Any] = {"state": "idle"}
        self._overall: OverallProgress | None = None
        self._started_s, self._step = 0.0, ""
        self.version = 0

    def start(
        self,
        kind: str,
        of: str,
        work: Callable[..., Mapping[str, Any]],
        *arguments: object,
        shares: Mapping[str, float] | None = None,
        step: str = "",
    ) -> None:
        """Begins a job. InputError where one is running.

        Args:
            kind: what it does, such as "fit".
            of: what it is done to: a recording, a result.
            work: a function of a module that takes a JobReporter and the arguments, all of which
                can be pickled, and returns what is known then; its InputError is told in a line.
            shares: of the time that its stages usually take; None: not known.
            step: of the page that mends an InputError which is no StepError.
        """
        with self._lock:
            if self._state["state"] == "running":
                raise InputError(
                    f"the {self._state['kind']} of {self._state['of']} is still running: wait for"
                    " its end, or stop it"
                )
            self._child, self._pictures = Child(_run, work, arguments), {}
            self._stopping, self._started_s, self._step = False, time.monotonic(), step
            self._overall = None if shares is None else OverallProgress(shares)
            self._state = {"state": "running", "kind": kind, "of": of, "notes": []}
            self._update(stage=_BEGINNING, done=0, total=None, part=None)
            self._thread = threading.Thread(
                target=self._listen, args=(self._child,), name="job of the page", daemon=True
            )
            self._thread.start()

    def status(self, kind: str | None = None, of: str | None = None) -> dict[str, Any]:
        """State: idle, running (stage, done, total, part, left_s, notes, and what the job tells),
        failed (error, the field at fault, the step that mends it), stopped, or done (with what the
        work returned). Idle, too, where the latest job is of another kind, or of something else.
        """
        with self._lock:
            state = dict(self._state)
        wanted = kind in (None, state.get("kind")) and of in (None, state.get("of"))
        return state if wanted else {"state": "idle"}

    def picture(self, name: str) -> bytes | None:
        """The newest picture of a name that the job has sent; None where there is none."""
        with self._lock:
            return self._pictures.get(name)

    def ask(self, word: str) -> None:
        """Asks something of the job that is running, which looks for it in its own time."""
        with self._lock:
            if self._state["state"] == "running" and self._child is not None:
                with suppress(OSError):  # it ends just now
                    self._child.pipe.send(word)

    def stop(self) -> None:
        """Ends the job that is running; nothing that it had not finished is left."""
        with self._lock:
            if self._state["state"] != "running" or self._child is None:
                return
            self._stopping, child = True, self._child
        child.terminate()
        threading.Thread(target=child.end, args=(_STOP_S,), daemon=True).start()

    def forget(self) -> None:
        """Becomes idle where no job is running: what the last one found counts no longer."""
        with self._lock:
            if self._state["state"] != "running":
                self._state = {"state": "idle"}
                self.version += 1

    def close(self) -> None:
        """Ends the job that is running, and waits for that."""
        self.stop()
        if self._thread is not None:
            self._thread.join(_STOP_S + 2)

    def _update(self, **changes: Any) -> None:
        self._state |= changes
        self.version += 1

    def _listen(self, child: Child) -> None:
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
                self._update_from(kind, content)
        child.pipe.close()

    def _update_from(self, kind: str, content: Any) -> None:
        if kind == "at":
            stage, done, total = content
            part = None if self._overall is None else self._overall.part(stage, done, total)
            elapsed_s = time.monotonic() - self._started_s
            known = part is not None and 100 * part > _SURE_PERCENT
            left_s = elapsed_s * (1 - part) / part if known and part else None
            self._update(stage=stage, done=done, total=total, part=part, left_s=left_s)
        elif kind == "note":
            self._update(notes=[*self._state["notes"], content][-_MOST_NOTES:])
        elif kind == "tell":
            self._update(**content)
        elif kind == "picture":
            name, picture = content
            self._pictures[name] = picture
        elif kind == "done":
            self._update(state="done", **content)
        elif self._stopping:
            self._update(state="stopped")
        else:
            error, step = content
            step, field = self._step if step is None else step, field_at_fault(error)
            self._update(state="failed", error=error, step=step, field=field)


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
