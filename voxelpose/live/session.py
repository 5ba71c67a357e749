"""A live session: capture, silhouettes, estimation and sending, each in threads of its own."""

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.image.seen_people import SeenPeople
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.jit import set_threads
from voxelpose.live.camera_source import CameraReader, CameraSource, Newest, Shot, ShotMatcher
from voxelpose.live.live_estimators import LiveEstimator, LiveMoment
from voxelpose.live.live_frame import LiveFrame, People, Phase, SessionState, hidden_note
from voxelpose.live.live_recorder import LiveRecorder, Masks
from voxelpose.live.live_silhouettes import EmptyView, PeopleInTurn, SilhouetteProcess, long_side_px
from voxelpose.multiview.tracking.body_track import Moment
from voxelpose.recording.subject import Subject
from voxelpose.tuning import LIVE

_RECENT = 60  # frames
_KEPT = 20_000  # frames: a session may last for days
_LEARNED_FRAMES = 45  # of the empty view, or of a room with people
_ROOM = "learning the room: walk about in it"
_MESSAGES: dict[Phase, str] = {
    "no background": "the empty view is not known: press Background and step out of the picture",
    "countdown": "step out of the picture",
    "learning": "learning the empty view: stay out of the picture",
    "searching": "looking for a person",
    "following": "following",
    "stopped": "stopped",
}


class StageTimes:
    """Durations by stage; may be read by any thread while one adds to them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.reset()

    def reset(self) -> None:
        """Forgets all frames, for example those of the first seconds."""
        with self._lock:
            self.frames = 0
            self._stages: dict[str, deque[float]] = {}
            self._ends: deque[float] = deque(maxlen=_RECENT)

    def add(self, stage_s: Mapping[str, float]) -> None:
        """Adds one frame's seconds by stage."""
        with self._lock:
            self.frames += 1
            self._ends.append(time.monotonic())
            for name, seconds in stage_s.items():
                self._stages.setdefault(name, deque(maxlen=_KEPT)).append(seconds)

    @property
    def fps(self) -> float:
        """Frames per second, of the last ones."""
        with self._lock:
            return _rate(list(self._ends))

    def medians(self) -> dict[str, float]:
        """Median seconds of every stage in the last frames."""
        return {name: float(np.median(spent[-_RECENT:])) for name, spent in self._seconds().items()}

    def summary(self) -> dict[str, list[float]]:
        """Shortest, longest, mean, median, 95 and 99 % quantile of every stage, s, since the start;
        of a long session in the last 20 000 frames.
        """
        return {
            name: [s.min(), s.max(), s.mean(), *np.quantile(s, (0.5, 0.95, 0.99))]
            for name, s in self._seconds().items()
        }

    def _seconds(self) -> dict[str, NDArray[np.float64]]:
        with self._lock:
            return {name: np.array(seconds) for name, seconds in self._stages.items()}


def _rate(times_s: Sequence[float]) -> float:
    """How many a second, of the times at which they came."""
    passed_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
    return (len(times_s) - 1) / passed_s if passed_s else 0.0


Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class SessionSettings:
    """Settings of a session."""

    rig: Rig
    sources: Mapping[str, CameraSource]  # of the cameras' pictures, by camera name
    # Pictures of the empty view by camera name; cameras that are missing make the session begin
    # with learning the background: with the pose network, while people are there.
    empty: Mapping[str, Sequence[Picture]] = field(default_factory=dict)
    # (H, W) bool, where the person may be, by camera name.
    regions: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    silhouettes_given: bool = False  # whether the pictures are silhouettes already
    subject: Subject = field(default_factory=Subject)
    fps: float | None = None  # rate at which files are played; None: their own
    loop: bool = False  # whether files begin again at their end
    countdown_s: float = 5.0  # from the button to the learning of the background
    # Recording folders to be made, one after the other, are this path and numbers after it; None:
    # recording is not possible.
    record: Path | None = None
    private: bool = False  # whether silhouettes alone are recorded
    people: int = 1  # who are followed at most
    network: Path | None = None  # the pose network's file

    @property
    def asked(self) -> tuple[str, ...]:
        """Cameras of whose pictures the pose network is asked: those without an empty view."""
        if self.network is None or self.silhouettes_given:
            return ()
        return tuple(name for name in self.rig.names if name not in self.empty)


@dataclass(frozen=True, eq=False)
class _Observed:
    """A moment on its way from the silhouettes to the estimation."""

    shot: Shot
    silhouettes: Moment
    prepared: object
    stage_s: Mapping[str, float]
    note: str


class LiveSession:
    """Runs from `start` to `close`; any thread may use the controls; tells its `receivers`."""

    def __init__(self, settings: SessionSettings, estimator: LiveEstimator):
        """Prepares the cameras, and begins the process of the silhouettes."""
        self.settings, self.times = settings, StageTimes()
        self._estimator = estimator
        self.receivers: list[Callable[[LiveFrame], None]] = []
        self._started_s, self._started_unix_s = time.monotonic(), time.time()
        names = settings.rig.names
        self._matcher = ShotMatcher(names, self._now, self._keep)
        self._observed: Newest[_Observed] = Newest()
        self._readers = [
            CameraReader(
                settings.sources[camera.name],
                camera.size,
                self._matcher.deliver,
                self._now,
                settings.fps,
                settings.loop,
            )
            for camera in settings.rig
        ]
        self._threads = [
            threading.Thread(target=self._run_stage, args=(work,), daemon=True)
            for work in (self._observe, self._estimate)
        ]
        self._failure: BaseException | None = None
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._phase: Phase = "no background"
        self._until_s, self._notice, self._followed = 0.0, "", 0
        self._silhouettes = SilhouetteProcess(settings.rig)
        self._subtracts = False  # whether the background is known
        self._empty: Mapping[str, Sequence[Picture]] = settings.empty
        self._learned: deque[Mapping[str, Picture]] = deque(maxlen=_LEARNED_FRAMES)
        self._learned_s = -np.inf  # when the last of them was taken
        self._arrived_s: deque[float] = deque(maxlen=_RECENT)
        self._recorder: LiveRecorder | None = None
        self._recordings, self._record_next = 0, False

    def start_cameras(self, record: bool = False) -> None:
        """Starts all threads, and recording, if wanted, as soon as the empty view is known."""
        self._record_next = record
        if self.settings.silhouettes_given or set(self._empty) >= set(self.settings.rig.names):
            self._subtract()
        self._started_s, self._started_unix_s = time.monotonic(), time.time()
        for thread in self._threads:
            thread.start()
        for reader in self._readers:
            reader.start()

    def wait(self, timeout_s: float) -> bool:
        """Waits for the session's end, at most so long; whether it has ended. Raises what a stage
        raised.
        """
        over = self._over.wait(timeout_s)
        if self._failure is not None:
            raise self._failure
        if all(reader.state == "ended" for reader in self._readers):
            time.sleep(0.2)  # the last pictures are still under way
            return True
        return over

    def close(self) -> None:
        """Ends all threads, releases the cameras and completes the recording."""
        self._over.set()
        for reader in self._readers:
            reader.stop()
        self._matcher.shots.close()
        self._observed.close()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()
        for reader in self._readers:
            reader.join()
        self.end_recording()
        self._estimator.close()
        self._silhouettes.close()

    @property
    def state(self) -> SessionState:
        """The session's state, for the page and the terminal."""
        with self._lock:
            phase, notice, recorder = self._phase, self._notice, self._recorder
            left_s, followed = self._until_s - self._now(), self._followed
        message = _ROOM if phase == "learning" and self.settings.asked else _MESSAGES[phase]
        if phase == "following" and self.settings.people > 1:
            message = f"{message} {followed} of {self.settings.people} people"
        if phase == "countdown":
            message = f"{message}: {max(left_s, 0):.0f} s"
        if recorder is not None and recorder.failure:
            notice = recorder.failure
        cameras = {reader.source.name: reader.state for reader in self._readers}
        working, stage_s = list(cameras.values()).count("ok"), self.times.medians()
        if phase in ("searching", "following") and working < min(2, len(cameras)):
            message = "waiting for cameras"
        return SessionState(
            phase,
            f"{message}. {notice}" if notice else message,
            recorder is not None and not recorder.failure,
            self.times.frames,
            self._matcher.shots.dropped + self._observed.dropped,
            self.times.fps,
            _rate(list(self._arrived_s)),
            stage_s.get("total", float("nan")),
            stage_s,
            cameras,
        )

    def learn_background(self) -> None:
        """Counts down, then learns the background from the empty view; where the pose network tells
        who is there, at once. Returns at once.
        """
        with self._lock:
            self._phase, self._notice = "learning" if self.settings.asked else "countdown", ""
            self._until_s = self._now() + self.settings.countdown_s
            self._learned.clear()

    def start(self) -> None:
        """Looks for a person and follows it."""
        with self._lock:
            if not self._subtracts:
                self._notice = "the empty view must be learned first"
            elif self._phase == "stopped":
                self._phase, self._notice = "searching", ""

    def stop(self) -> None:
        """Stops the estimation; the cameras go on."""
        with self._lock:
            if self._phase in ("searching", "following"):
                self._phase = "stopped"

    def record(self) -> None:
        """Begins to record; says in the state why where it cannot."""
        settings = self.settings
        with self._lock:
            if settings.record is None:
                self._notice = "recording needs a folder: start with --record FOLDER"
                return
            if self._recorder is not None and not self._recorder.failure:
                return
            self._recordings += 1
            folder, number = settings.record, self._recordings
        if number > 1:
            folder = folder.with_name(f"{folder.name}_{number}")
        recorder, notice = None, ""
        try:
            # Not under the lock: the empty view takes a second to write.
            recorder = LiveRecorder(
                folder, settings.rig, settings.subject, self._empty, settings.private
            )
        except InputError as error:
            notice = str(error)
        with self._lock:
            self._recorder, self._notice = recorder, notice

    def end_recording(self) -> None:
        """Ends and completes the recording."""
        with self._lock:
            recorder, self._recorder = self._recorder, None
        if recorder is not None:
            recorder.close()
            note = recorder.failure or f"{recorder.folder}: {recorder.written} frames recorded"
            with self._lock:
                self._notice = note

    def _now(self) -> float:
        return time.monotonic() - self._started_s

    def _run_stage(self, work: Callable[[], None]) -> None:
        """Runs a stage; what it raises ends the session."""
        try:
            set_threads(1)
            work()
        except BaseException as error:
            self._failure = error
            self._over.set()

    def _observe(self) -> None:
        looked_s = -np.inf
        while (shot := self._matcher.shots.take()) is not None:
            begun_s = self._now()
            phase = self._prepare(shot)
            if phase == "searching" and shot.time_s - looked_s < LIVE.searching_s:
                continue
            if phase not in ("searching", "following"):
                self._show(shot, {}, (None,) * self.settings.people)
                continue
            looked_s = shot.time_s
            silhouettes, others = self._silhouettes.of(shot.time_s, shot.pictures)
            pictures = shot.pictures if len(self.settings.rig) == 1 else {}
            prepared = self._estimator.prepare(
                LiveMoment(shot.number, shot.time_s, silhouettes, pictures)
            )
            done_s = self._now()
            if (recorder := self._recorder) is not None and recorder.private:
                recorder.put(shot, silhouettes.masks())
            several = len(others) >= min(2, len(shot.pictures)) and self.settings.people == 1
            note = "somebody else is in the picture" if several else ""
            stage_s = {"capture": begun_s - shot.time_s, "silhouettes": done_s - begun_s}
            self._observed.put(_Observed(shot, silhouettes, prepared, stage_s, note))

    def _prepare(self, shot: Shot) -> Phase:
        """Phase for a moment; learns the background in between."""
        with self._lock:
            if self._phase == "countdown" and self._now() >= self._until_s:
                self._phase = "learning"
            phase = self._phase
            if phase == "learning" and set(shot.pictures) == set(self.settings.rig.names):
                # A room with people shows more of itself in some seconds than in one.
                apart_s = LIVE.searching_s if self.settings.asked else 0.0
                if shot.time_s - self._learned_s >= apart_s:
                    self._learned.append(shot.pictures)
                    self._learned_s = shot.time_s
            learned = phase == "learning" and len(self._learned) == _LEARNED_FRAMES
        if learned:
            moments = [*self._learned]
            self._learned.clear()
            if not self.settings.asked:
                self._empty = {
                    name: [pictures[name] for pictures in moments]
                    for name in self.settings.rig.names
                }
            self._subtract(moments)
        return phase

    def _subtract(self, moments: Sequence[Mapping[str, Picture]] = ()) -> None:
        """Makes the background models, of cameras without an empty view by moments with people; the
        search for a person begins.
        """
        settings = self.settings
        rig, regions, people = settings.rig, settings.regions, None
        if settings.network is not None and settings.asked:
            people = SeenPeople(settings.asked, settings.network)
        view = EmptyView(rig, self._empty, regions, settings.silhouettes_given, moments)
        silhouettes = Silhouettes(view, "auto", long_side_px(rig), ahead=False, people=people)
        silhouettes.people = None if people is None else PeopleInTurn(people.windows)
        self._silhouettes.learn(silhouettes)
        # Loads the kernels before the first frame is there.
        last = {name: images[-1] for name, images in self._empty.items()}
        self._silhouettes.of(0.0, {**(moments[-1] if moments else {}), **last})
        if self._record_next:
            self._record_next = False
            self.record()
        with self._lock:
            self._subtracts, self._phase = True, "searching"

    def _estimate(self) -> None:
        while (observed := self._observed.take()) is not None:
            begun_s = self._now()
            shot = observed.shot
            people = self._estimator.step(observed.prepared)
            done_s = self._now()
            with self._lock:
                self._followed = sum(body is not None for body in people)
                if self._phase in ("searching", "following"):
                    self._phase = "following" if self._followed else "searching"
            stage_s = {
                **observed.stage_s,
                "waiting": begun_s - shot.time_s - sum(observed.stage_s.values()),
                "estimation": done_s - begun_s,
            }
            note = observed.note or hidden_note(people)
            self._show(shot, observed.silhouettes.masks(), people, note)
            sent_s = self._now()
            self.times.add({**stage_s, "send": sent_s - done_s, "total": sent_s - shot.time_s})

    def _show(self, shot: Shot, masks: Masks, people: People, note: str = "") -> None:
        """Hands a moment, with what was found in it, to all receivers."""
        number, time_s, taken_s = shot.number, shot.time_s, self._started_unix_s + shot.time_s
        frame = LiveFrame(number, time_s, shot.pictures, masks, people, note, taken_s)
        for receive in self.receivers:
            receive(frame)

    def _keep(self, shot: Shot) -> None:
        """Records pictures, also those that the estimation has no time for."""
        self._arrived_s.append(time.monotonic())
        if (recorder := self._recorder) is not None:
            recorder.put(shot)
