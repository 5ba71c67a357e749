"""The check of the cameras, in a thread of its own, with its progress and its findings."""

import threading
import traceback
from typing import Any

from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.calibration.check import Check, check_recording, remedy, verdict_on
from voxelpose.calibration.pictures import draw_check
from voxelpose.recording.folder import Recording
from voxelpose.view.images.canvas import png


class _Ended(BaseException):
    """The session ends: nobody waits for the findings."""


class _Progress(Reporter):
    """Progress that can be asked for from another thread, and ends the work where it is told to."""

    def __init__(self) -> None:
        self.name, self.done, self.total = "beginning", 0, None
        self.ended = threading.Event()

    def stage(self, name: str, total: int | None = None) -> None:
        self._look()
        self.name, self.done, self.total = name, 0, total

    def advance(self, steps: int = 1) -> None:
        self._look()
        self.done += steps

    def note(self, text: str) -> None:
        """Does nothing: the findings have the notes."""

    def _look(self) -> None:
        if self.ended.is_set():
            raise _Ended


class CheckJob:
    """At most one check at a time, whose findings stay until the next."""

    def __init__(self, recording: Recording) -> None:
        """Starts nothing; the recording has a calibration."""
        self._recording = recording
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._progress = _Progress()
        self._findings: dict[str, Any] = {"state": "idle"}
        self._picture: bytes | None = None

    def start(self) -> None:
        """Begins a check, if none is running."""
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                return
            self._progress = _Progress()
            self._findings, self._picture = {"state": "running"}, None
            self._thread = threading.Thread(target=self._run, name="check", daemon=True)
            self._thread.start()

    def status(self) -> dict[str, Any]:
        """State: idle, running (stage, done, total), failed (error) or done, with the findings."""
        if self._findings["state"] != "running":
            return self._findings
        progress = self._progress
        where = {"stage": progress.name, "done": progress.done, "total": progress.total}
        return self._findings | where

    def picture(self) -> bytes:
        """PNG of the last check. InputError where there is none."""
        if self._picture is None:
            raise InputError("the cameras have not been checked")
        return self._picture

    def close(self) -> None:
        """Ends a check that is running."""
        self._progress.ended.set()
        if self._thread is not None:
            self._thread.join(5.0)

    def _run(self) -> None:
        try:
            check = check_recording(self._recording, None, self._progress)
            self._picture = png(draw_check(check))
            self._findings = _findings_of(check)
        except _Ended:
            self._findings = {"state": "idle"}
        except InputError as error:
            self._findings = {"state": "failed", "error": str(error)}
        except Exception:
            words = "the check broke off: the terminal shows the reason"
            self._findings = {"state": "failed", "error": words}
            traceback.print_exc()


def _findings_of(check: Check) -> dict[str, Any]:
    """What a check found, as `voxelpose calibrate check` prints it."""
    return {
        "state": "done",
        "agrees": check.agreement.agrees,
        "summary": check.agreement.summary,
        "cameras": [
            {
                "camera": line.camera,
                "error_px": line.error_px,
                "others_px": line.others_px,
                "planes": line.planes,
                "verdict": verdict_on(check, line.camera),
            }
            for line in check.agreement.table
        ],
        "repairs": [
            {"summary": repair.summary, "remedy": remedy(check, repair.camera)}
            for repair in check.repairs
        ],
        "after": None if check.after is None else check.after.summary,
        "notes": list(check.notes),
    }
