"""voxelpose live."""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import Meta
from tyro.conf import Positional, UseAppendAction, arg

from calib.errors import InputError
from silhouette_core import setting_types
from silhouette_core.network_files import POSE_NETWORK
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress, plain, print_table, rich_console

if TYPE_CHECKING:
    from rich.status import Status

    from silhouette_core.progress import Reporter
    from voxelpose.live.live_frame import SessionState
    from voxelpose.live.live_page import Page
    from voxelpose.live.senders import Senders
    from voxelpose.live.session import LiveSession
_STATUS_EVERY_S = 1


def show_state(state: SessionState, line: Status, printed: tuple[str, ...]) -> tuple[str, ...]:
    """Shows a session's state: in one changing line on a terminal, elsewhere, where it is not what
    was said before, in a new one; returns what has been said.
    """
    wrong = tuple(f"{name}: {words}" for name, words in state.cameras.items() if words != "ok")
    if sys.stderr.isatty():
        numbers = f"{state.fps:.0f} of {state.arriving_fps:.0f} frames a second"
        if math.isfinite(state.latency_s):
            numbers += f", {1000 * state.latency_s:.0f} ms from picture to pose"
        line.update(plain("; ".join([state.message, numbers, *wrong])))
        return printed
    # Seconds that count down are no news.
    message = state.message.partition(":")[0] if state.phase == "countdown" else state.message
    if (message, *wrong) != printed:
        print("; ".join((message, *wrong)), file=sys.stderr, flush=True)
    return message, *wrong


def print_session(session: LiveSession) -> None:
    """Prints frames, dropped frames and the durations of the stages of a session."""
    rows = [
        (name, *(f"{1000 * value:.1f}" for value in values))
        for name, values in session.times.summary().items()
    ]
    print_table(
        rows, "stage", *(f"{name} ms" for name in ("min", "max", "mean", "median", "95 %", "99 %"))
    )
    print(f"{session.state.frames} frames estimated, {session.state.dropped} dropped")
    if session.settings.asked:
        cameras = ", ".join(session.settings.asked)
        print(f"network: {POSE_NETWORK.sha256}, asked of {cameras}")


@dataclass(frozen=True, kw_only=True)
class Live(arguments.PageArguments, arguments.PosingArguments):
    """Follows a person before running cameras, or several, shows and sends the motion.

    FOLDER holds the calibration and, if possible, background/ with the empty view. Its videos are
    played at their own rate where no --source is given. With several cameras the body is followed
    in space; with --camera NAME, or a single source, by the network as in `voxelpose track`. Three
    cameras or more follow several people (--people). Ctrl-C ends the session.

      voxelpose live studio --source cam_1=0 --source cam_2=1 --stature 1.75
      voxelpose live studio --source cam_1=rtsp://192.168.0.20/stream --camera cam_1
      voxelpose live --source 0 --stature 1.75 --send vmc://127.0.0.1:39539
      voxelpose live dance --people 2 --send ws://127.0.0.1:8765
      voxelpose live walk --loop --record rehearsal --private
      voxelpose live walk --camera cam_1 --method paper --stature 1.75
    """

    groups: ClassVar = arguments.GROUPS
    folder: Annotated[Positional[Path | None], arg(metavar="FOLDER")] = None
    """Folder with calibration.toml, background/ and subject.toml, as of a recording."""
    source: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=ADDRESS")] = ()
    """Number of a webcam, address of a stream (rtsp://, http://) or a video; may be repeated."""
    camera: Annotated[str | None, arguments.optional("NAME")] = None
    """Use this camera alone."""
    cameras: arguments.Cameras = None
    people: Annotated[int, arg(metavar="N")] = 1
    """Number of people: each is followed, and keeps its number. 1: one, whoever else passes by."""
    method: arguments.Method = "learned"
    library: Annotated[Path | None, arguments.optional("LIB")] = None
    """Pose library of one camera. Default: the network that comes with the program."""
    start: setting_types.Start = "any"
    """Assumption about the first pose before one camera: facing it upright, or none."""
    outline_only: Annotated[bool, arg(name="outline-only")] = False
    """With one camera, leave out the colours inside the outline."""
    send: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="ADDRESS")] = ()
    """Receiver of the motion: vmc://HOST:PORT or ws://HOST:PORT/PATH; may be repeated."""
    page: bool = True
    """Serve the page that shows the figure; --no-page leaves it out."""
    record: Annotated[Path | None, arguments.optional("OUT")] = None
    """Recording folder to be made; --no-record-now leaves the beginning to the button, which
    without --record makes live_DATE_TIME in the current folder."""
    record_now: Annotated[bool, arg(name="record-now")] = True
    """Begin to record as soon as the empty view is known."""
    private: bool = False
    """Record silhouettes instead of pictures."""
    loop: bool = False
    """Begin videos again at their end."""
    countdown: Annotated[float, Meta(ge=0, le=3600), arg(metavar="S")] = 5.0
    """Seconds to step out of the picture before the empty view is learned."""
    duration: Annotated[float | None, arguments.optional("S")] = None
    """End after so many seconds. Default: with the videos, or at Ctrl-C."""

    def run(self) -> None:
        """Runs the session."""
        self.check()
        with Progress() as progress:
            progress.note_compilation("multiview")
            session = self.prepare(progress)
        with ExitStack() as parts:
            parts.callback(session.close)
            from voxelpose.live.senders import Senders

            senders = Senders(self.send)
            parts.callback(senders.close)
            session.receivers.append(senders.send)
            if self.page:
                page = self._page(session, senders)
                parts.callback(page.close)
                session.receivers.append(page.show)
            try:
                self._wait(session)
            except KeyboardInterrupt:  # how a session usually ends
                print(file=sys.stderr)
        print_session(session)

    def prepare(self, reporter: Reporter) -> LiveSession:
        """The session, whose cameras are not running yet. InputError where something is missing, or
        does not fit.
        """
        reporter.stage("loading the program")
        from silhouette_core.estimator import ONE_PERSONS, Settings
        from silhouette_core.image.seen_people import network_for
        from voxelpose.live.camera_source import CameraSource
        from voxelpose.live.live_input import make_estimator, open_input
        from voxelpose.live.session import LiveSession
        from voxelpose.recording.subject import Subject

        reporter.stage("reading calibration and empty view")
        sources = [CameraSource.parse(text) for text in self.source]
        names = (self.camera,) if self.camera is not None else arguments.camera_names(self.cameras)
        live = open_input(self.folder, sources, names, self.unit, self.fps, self.label)
        live = live.upright(arguments.up_direction(self.up), reporter)
        known = live.recording.subject
        subject = replace(
            known,
            stature_m=self.stature or known.stature_m,
            chest_girth_m=self.chest or known.chest_girth_m,
            sex=self.sex if self.sex != "unknown" else known.sex,
        )
        options = arguments.unusual(self, {"outline_only": "outline_only", "library": "library"})
        options["start"] = self.start
        settings = Settings(
            stature_m=subject.stature_m,
            chest_m=subject.chest_girth_m,
            sex=subject.sex,  # type: ignore[arg-type]
            smooth=False,
            backend=self.backend,
            options=options if len(live.recording.rig) == 1 else {},
        )
        if self.people > 1 and settings != settings.of_anybody:
            reporter.note(ONE_PERSONS)
            settings, subject = settings.of_anybody, Subject()
        session_settings = live.settings(subject)
        missing = [name for name in live.recording.rig.names if name not in session_settings.empty]
        given = session_settings.silhouettes_given
        session_settings = replace(
            session_settings,
            network=None if given else network_for(missing, self.network, reporter),
            loop=self.loop,
            countdown_s=self.countdown,
            record=self.record or Path(time.strftime("live_%Y-%m-%d_%H-%M-%S")),
            private=self.private,
            people=self.people,
        )
        reporter.stage("preparing the estimation")
        estimator = make_estimator(
            live, settings, reporter, arguments.ESTIMATORS[self.method], self.people
        )
        return LiveSession(session_settings, estimator)

    def check(self) -> None:
        """Refuses, by an InputError, what cannot be done, before anything is begun."""
        if self.folder is not None and not self.folder.is_dir():
            raise InputError(f"there is no folder {self.folder}: give one with calibration.toml")
        from voxelpose.live.senders import parse_receiver
        from voxelpose.multiview.people import number_of_people

        if self.camera is not None and self.cameras is not None:
            raise InputError("--camera and --cameras exclude each other: give one of them")
        if self.record is not None and self.record.exists():
            raise InputError(f"{self.record} exists: give --record another name")
        if self.duration is not None and not self.duration > 0:
            raise InputError(f"--duration {self.duration:g} is impossible: give seconds above 0")
        if self.page:
            self.address()
        number_of_people(str(self.people), auto=False)
        for address in self.send:
            parse_receiver(address, self.people)

    def _page(self, session: LiveSession, senders: Senders) -> Page:
        from voxelpose.live.live_page import Page

        cameras = session.settings.rig.cameras
        title = "voxelpose live"
        if self.folder is not None:
            title = f"{self.folder.resolve().name} – {title}"
        people = session.settings.people
        page = Page(session, cameras, self.address(), lambda: senders.states, title, people)
        print(f"page: {page.url} (Ctrl-C ends the session)", file=sys.stderr, flush=True)
        self.open_page(page.url)
        return page

    def _wait(self, session: LiveSession) -> None:
        printed: tuple[str, ...] = ()
        with rich_console(stderr=True).status("") as line:
            session.start_cameras(self.record is not None and self.record_now)
            if session.state.phase == "no background":
                session.learn_background()
            end_s = None if self.duration is None else time.monotonic() + self.duration
            while not session.wait(_STATUS_EVERY_S):
                printed = show_state(session.state, line, printed)
                if end_s is not None and time.monotonic() >= end_s:
                    break
