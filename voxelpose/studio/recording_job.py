"""Cameras shown and recorded, in a process of its own: first the empty view, then the take."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.board import Board, BoardView
from calib.camera import Rig
from calib.errors import InputError
from calib.intrinsics import corner_coverage
from calib.storage.atomic import writing
from voxelpose.calibration.board_views import BoardFinder
from voxelpose.live.camera_source import CameraReader, CameraSource, Shot, ShotMatcher
from voxelpose.live.live_recorder import LiveRecorder
from voxelpose.recording.camera_files import pictures_by_camera
from voxelpose.recording.folder import default_camera
from voxelpose.recording.subject import Subject
from voxelpose.recording.timestamps import TIMESTAMPS
from voxelpose.view.images.canvas import encoded, reduced
from voxelpose.view.serving.page_job import JobReporter

_STAGED, _OLD = ".take", ".replaced"  # folders of a project, while it is written
_LOOK_MS = 50
_SHOWN_EVERY_MS = 250
_SHOWN_PX = 480
_MOST_EMPTY = 30  # pictures of the empty view


@dataclass(frozen=True)
class RecordingPlan:
    """What is recorded, and where."""

    # Receives the pictures of every camera, in a folder each, and their times; the empty view goes
    # into background/ there.
    target: Path
    sources: tuple[CameraSource, ...]
    # (width, height) px of the cameras' pictures where known; the others' are taken as they come.
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    loop: bool = True
    countdown_s: float = 5.0  # to step out of the pictures, and into them again
    empty_s: float = 2.0  # how long the empty view is looked at; 0: there is none
    length_s: float | None = None  # how long is recorded; None: until it is asked to finish
    every_s: float = 0.0  # least time between two recorded moments
    board: Board | None = None  # that is filmed, and looked for meanwhile; None: none is


def record(reporter: JobReporter, plan: RecordingPlan) -> dict[str, Any]:
    """Shows the cameras until it is asked to "record", then records until it is asked to "finish",
    or to the end of its time or of the videos that stand for cameras; returns the number of
    `moments` and their `seconds`. InputError where a user can correct something.
    """
    with _Filming(reporter, plan) as filming:
        return filming.run()


class _Filming:
    def __init__(self, reporter: JobReporter, plan: RecordingPlan) -> None:
        self._reporter, self._plan = reporter, plan
        self._started_s = time.monotonic()
        names = [source.name for source in plan.sources]
        self._matcher = ShotMatcher(names, self._now, self._record_moment)
        self._readers = [
            CameraReader(
                source, plan.sizes.get(source.name), self._deliver, self._now, None, plan.loop
            )
            for source in plan.sources
        ]
        self._newest: dict[str, NDArray[np.uint8]] = {}
        self._counts = dict.fromkeys(names, 0)
        self._empty: dict[str, list[NDArray[np.uint8]]] | None = None
        self._recorder: LiveRecorder | None = None
        self._recorded_s: list[float] = []
        self._finders = {
            name: BoardFinder(plan.board, stills=False) for name in names if plan.board is not None
        }
        self._coverage: dict[str, NDArray[np.int64]] = {}
        self._shown_s = 0.0

    def __enter__(self) -> _Filming:
        self._clear()
        for reader in self._readers:
            reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        for reader in self._readers:
            reader.stop()
        if self._recorder is not None:
            self._recorder.close()
        for reader in self._readers:
            reader.join()
        self._clear()

    def run(self) -> dict[str, Any]:
        """All of it, from the first look to the finished files."""
        plan, reporter = self._plan, self._reporter
        reporter.stage("cameras")
        self._wait("preview", None, "record")
        if set(self._newest) < {reader.source.name for reader in self._readers}:
            lacking = [name for name in self._counts if name not in self._newest]
            raise InputError(
                f"no picture of {', '.join(lacking)}: correct the address, or leave the camera out"
            )
        empty: dict[str, list[NDArray[np.uint8]]] = {}
        if plan.empty_s:
            self._wait("step out", plan.countdown_s)
            self._empty = empty
            self._wait("empty view", plan.empty_s)  # and until every camera has shown it
            self._empty = None
            self._wait("step in", plan.countdown_s)
        self._begin(empty)
        self._wait("recording", plan.length_s, "finish")
        return self._finish()

    def _now(self) -> float:
        return time.monotonic() - self._started_s

    def _deliver(self, name: str, time_s: float, picture: NDArray[np.uint8]) -> None:
        self._newest[name] = picture
        self._counts[name] += 1
        self._matcher.deliver(name, time_s, picture)

    def _record_moment(self, shot: Shot) -> None:
        if (empty := self._empty) is not None:
            for name, picture in shot.pictures.items():
                pictures = empty.setdefault(name, [])
                if len(pictures) < _MOST_EMPTY:
                    pictures.append(picture)
        recorder, times_s = self._recorder, self._recorded_s
        early = times_s and shot.time_s - times_s[-1] < self._plan.every_s
        if recorder is not None and not early and len(shot.pictures) == len(self._readers):
            times_s.append(shot.time_s)
            recorder.put(shot)

    def _wait(self, phase: str, seconds: float | None, word: str = "") -> None:
        """Shows the cameras for a time, or until it is asked for something. InputError where a
        camera cannot be used, or recording has ended by itself.
        """
        begun_s, asked = time.monotonic(), None
        while asked != word or not word:
            passed_s = time.monotonic() - begun_s
            has_empty = self._empty is None or len(self._empty) == len(self._readers)
            if seconds is not None and passed_s >= seconds and has_empty:
                return
            self._show(phase, None if seconds is None else max(seconds - passed_s, 0.0))
            if self._recorder is not None:
                if self._recorder.failure:
                    raise InputError(self._recorder.failure)
                if all(reader.state == "ended" for reader in self._readers):
                    return
            time.sleep(_LOOK_MS / 1000)
            asked = self._reporter.asked() or asked

    def _show(self, phase: str, left_s: float | None) -> None:
        """Sends pictures and the state of the cameras, now and then."""
        now_s = self._now()
        if now_s - self._shown_s < _SHOWN_EVERY_MS / 1000:
            return
        self._shown_s = now_s
        cameras = [self._show_camera(reader) for reader in self._readers]
        moments = len(self._recorded_s)
        self._reporter.tell(phase=phase, phase_left_s=left_s, cameras=cameras, moments=moments)

    def _show_camera(self, reader: CameraReader) -> dict[str, Any]:
        """Sends a camera's picture; returns its state, and where in it the board has been seen
        while it was recorded.
        """
        name = reader.source.name
        known = {"name": name, "state": reader.state, "pictures": self._counts[name], "size": None}
        picture = self._newest.get(name)
        if picture is None:
            return known
        image = reduced(picture, _SHOWN_PX / max(picture.shape))
        self._reporter.picture(name, encoded(image, ".jpg", 75))
        known["size"] = size = picture.shape[1], picture.shape[0]
        if name in self._finders:
            finder = self._finders[name]
            view = finder(picture)
            printed = finder.board.as_printed(picture) if isinstance(view, str) else None
            if printed not in (None, finder.board):  # as the commands will take it
                self._finders = {one: BoardFinder(printed, stills=False) for one in self._finders}
                view = self._finders[name](picture)
            known["sees"] = isinstance(view, BoardView)
            cells = self._coverage.setdefault(name, corner_coverage([], size))
            if isinstance(view, BoardView) and self._recorder is not None:
                cells += corner_coverage([view], size)
            known["corners_per_cell"] = cells.tolist()
        return known

    def _begin(self, empty: Mapping[str, list[NDArray[np.uint8]]]) -> None:
        cameras = []
        for source in self._plan.sources:
            height, width = self._newest[source.name].shape[:2]
            cameras.append(default_camera(source.name, (width, height)))
        staged = self._plan.target / _STAGED
        self._recorder = LiveRecorder(staged, Rig(tuple(cameras)), Subject(), empty)

    def _finish(self) -> dict[str, Any]:
        """Puts what was recorded in its place. InputError where there is too little."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            raise InputError("nothing was recorded: start again")
        recorder.close()
        self._reporter.stage("files")
        if recorder.failure:
            raise InputError(recorder.failure)
        if recorder.written < 2:
            states = "; ".join(f"{reader.source.name}: {reader.state}" for reader in self._readers)
            raise InputError(
                "at no moment did all cameras send a picture, so nothing is kept: cameras of one"
                f" rate are needed ({states})"
            )
        put_in_place(recorder.folder, self._plan.target)
        times_s = self._recorded_s
        return {
            "moments": recorder.written,
            "seconds": times_s[-1] - times_s[0],
            "lost": len(times_s) - recorder.written,
        }

    def _clear(self) -> None:
        """Removes what is left of a recording that was not finished."""
        shutil.rmtree(self._plan.target / _STAGED, ignore_errors=True)


def put_in_place(staged: Path, target: Path) -> None:
    """Moves a recording's pictures and times from one folder into another of the same disk, where
    they take the place of an earlier recording's; its calibration and subject stay behind.
    InputError where the system refuses.
    """
    old = target / _OLD
    with writing(target):
        shutil.rmtree(old, ignore_errors=True)
        (old / "background").mkdir(parents=True)
        for path in (*pictures_by_camera(target).values(), target / TIMESTAMPS):
            if path.exists():
                path.rename(old / path.name)
        empty = target / "background"
        for name, pictures in pictures_by_camera(staged / "background").items():
            empty.mkdir(exist_ok=True)
            earlier = pictures_by_camera(empty, stills=True).get(name)
            if earlier is not None:
                earlier.rename(old / "background" / earlier.name)
            pictures.rename(empty / name)
        for path in (*pictures_by_camera(staged).values(), staged / TIMESTAMPS):
            path.rename(target / path.name)
        shutil.rmtree(old)
