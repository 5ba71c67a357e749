"""Pictures of live cameras: from a webcam, a stream, or a file played at its own rate, and those of
several cameras that were taken at one moment, matched by their time stamps.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Literal, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader, size_text
from voxelpose.tuning import LIVE

Frame = NDArray[np.uint8]
Deliver = Callable[[str, float, Frame], None]
"""Receives camera name, time of capture (s since the session's start) and picture."""

_SCHEMES = ("rtsp://", "rtsps://", "http://", "https://", "udp://", "rtp://")
_TIMEOUT_MS = 4000  # for a stream to open, and for its next picture
_DARK, _GRID = 14, 16  # brightest value of a black picture, and px between the pixels looked at
_KEPT = 4  # pictures of each camera that wait for the others'
_BEGINNING_S = 2  # in which every camera's first picture is waited for
_SMOOTHED = 10  # intervals between pictures in their running mean


@dataclass(frozen=True)
class CameraSource:
    """Address of one camera's pictures: number of a webcam, address of a stream, or a video, whose
    reader may be given.
    """

    name: str
    address: str
    reader: FrameReader | None = None

    @classmethod
    def parse(cls, text: str) -> "CameraSource":
        """Reads [NAME=]ADDRESS. InputError where there is no address, or it is a file that does not
        exist.
        """
        name, equals, address = text.partition("=")
        # An address may hold an equals sign of its own.
        if not equals or "/" in name or ":" in name:
            name, address = "", text
        source = cls(name.strip(), address.strip())
        if not source.address:
            raise InputError(
                f"--source {text} names no camera: give NAME=NUMBER of a webcam, NAME=rtsp://...,"
                " or NAME=FILE"
            )
        if source.kind == "file" and not Path(source.address).exists():
            raise InputError(
                f"{source.address} is neither the number of a webcam, nor an address such as"
                " rtsp://..., nor a file that is there"
            )
        return source

    @property
    def kind(self) -> Literal["webcam", "stream", "file"]:
        """How the pictures are read."""
        if self.address.isdecimal():
            return "webcam"
        return "stream" if self.address.lower().startswith(_SCHEMES) else "file"


def list_webcams() -> dict[int, str]:
    """Names of this machine's webcams by their numbers, where the system tells (Linux); elsewhere
    none.
    """
    names = {}
    for folder in Path("/sys/class/video4linux").glob("video*"):
        number = folder.name.removeprefix("video")
        with suppress(OSError, UnicodeError):
            # A camera has further devices, without pictures.
            if number.isdecimal() and (folder / "index").read_text("utf-8").strip() == "0":
                names[int(number)] = (folder / "name").read_text("utf-8").strip()
    return dict(sorted(names.items()))


def retry_waits_s() -> Iterator[float]:
    """Yields waits before a camera or receiver that failed is tried again and again, s."""
    wait_s = 0.5
    while True:
        yield wait_s
        wait_s = min(2 * wait_s, 8.0)


class CameraReader:
    """Reads one camera in a thread of its own, and tries again for ever where it fails. Its state
    is "ok", "ended" where no picture will come any more, or a line that says what is wrong.

    Args:
        size: (width, height) px for which the camera is calibrated; None: as its pictures come.
        now: seconds since the session's start.
        fps: rate at which a file is played; None: the file's own.
    """

    def __init__(
        self,
        source: CameraSource,
        size: tuple[int, int] | None,
        deliver: Deliver,
        now: Callable[[], float],
        fps: float | None = None,
        loop: bool = False,
    ):
        self.source, self.state, self.pictures = source, "connecting", 0
        self._size, self._deliver, self._now = size, deliver, now
        self._fps, self._loop = fps, loop
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {source.name}", daemon=True)

    def start(self) -> None:
        """Begins to read."""
        self._thread.start()

    def stop(self) -> None:
        """Ends reading; returns at once."""
        self._stop.set()

    def join(self) -> None:
        """Waits until the camera is released."""
        if self._thread.ident is not None:
            self._thread.join(2 * _TIMEOUT_MS / 1000)

    def _run(self) -> None:
        waits_s = retry_waits_s()
        while not self._stop.is_set():
            before = self.pictures
            try:
                if self.source.kind == "file":
                    self._play()
                    self.state = "ended"
                    return
                self._capture()
            except InputError as error:
                self.state = str(error)
            if self.pictures > before:
                waits_s = retry_waits_s()
            wait_s = next(waits_s)
            if not self._stop.is_set():
                self.state = f"no picture: trying again every {wait_s:g} s"
            self._stop.wait(wait_s)

    def _capture(self) -> None:
        """Reads a webcam or a stream until it fails."""
        if self.source.kind == "webcam":
            capture = cv2.VideoCapture(int(self.source.address))
            if self._size is not None:
                capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._size[0])
                capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._size[1])
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        else:
            timeouts = cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, cv2.CAP_PROP_READ_TIMEOUT_MSEC
            limits = [number for kind in timeouts for number in (kind, _TIMEOUT_MS)]
            capture = cv2.VideoCapture(self.source.address, cv2.CAP_FFMPEG, limits)
        try:
            while not self._stop.is_set() and capture.grab():
                taken_s = self._now()
                good, picture = capture.retrieve()
                if not good:
                    return
                self._hand_over(taken_s, np.asarray(picture, np.uint8))
        finally:
            capture.release()

    def _play(self) -> None:
        """Plays a file at its rate; pictures whose time has passed are left out."""
        reader = self.source.reader or FrameReader.open(Path(self.source.address))
        fps = self._fps or reader.fps or 30.0
        for number, picture in enumerate(self._pictures(reader)):
            due_s = number / fps
            late_s = self._now() - due_s
            if late_s > 2 / fps:
                continue
            if self._stop.wait(max(-late_s, 0.0)):
                return
            self._hand_over(due_s, picture)

    def _pictures(self, reader: FrameReader) -> Iterator[Frame]:
        while not self._stop.is_set():
            for picture in reader:
                # The decoder writes the next picture into the same memory.
                yield picture.copy()
            if not self._loop:
                return

    def _hand_over(self, taken_s: float, picture: Frame) -> None:
        size = picture.shape[1], picture.shape[0]
        self._size = self._size or size
        width, height = self._size
        if size != self._size:
            if abs(size[0] * height - size[1] * width) > 0.01 * size[0] * height:
                self.state = (
                    f"pictures are {size_text(size)} px, calibrated at {size_text(self._size)}: set"
                    " the camera to the calibrated format"
                )
                return
            way = cv2.INTER_AREA if size[0] > width else cv2.INTER_LINEAR
            picture = np.asarray(cv2.resize(picture, self._size, interpolation=way), np.uint8)
        if int(picture[::_GRID, ::_GRID].max()) < _DARK:
            self.state = "black pictures: is the lens covered, or another program using the camera?"
            return
        self.state = "ok"
        self.pictures += 1
        self._deliver(self.source.name, taken_s, picture)


_Item = TypeVar("_Item")


class Newest(Generic[_Item]):
    """Place for one item between two threads: a newer one replaces it, and is `dropped`."""

    def __init__(self) -> None:
        self.dropped = 0
        self._item: _Item | None = None
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: _Item) -> None:
        """Puts an item there."""
        with self._changed:
            self.dropped += self._item is not None
            self._item = item
            self._changed.notify()

    def take(self) -> _Item | None:
        """Waits for an item and takes it; None after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            return None if self._closed else item

    def close(self) -> None:
        """Wakes whoever waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


@dataclass(frozen=True, eq=False)
class Shot:
    """Pictures taken at one moment."""

    number: int  # counted from 0, shots that nobody took included
    time_s: float  # of the moment, s since the session's start
    pictures: Mapping[str, NDArray[np.uint8]]  # (H, W, 3) uint8 BGR by camera name


@dataclass(eq=False)
class _Stream:
    """Latest pictures of one camera, their interval, and the time of that in the last shot."""

    pictures: deque[tuple[float, NDArray[np.uint8]]]
    interval_s: float = 0.0
    used_s: float = -np.inf

    @property
    def newest_s(self) -> float:
        return self.pictures[-1][0] if self.pictures else -np.inf

    def add(self, time_s: float, picture: NDArray[np.uint8]) -> None:
        step = time_s - self.newest_s
        if np.isfinite(step):
            old = self.interval_s
            self.interval_s = step if not old else old + (step - old) / _SMOOTHED
        self.pictures.append((time_s, picture))

    def nearest(self, time_s: float) -> tuple[float, NDArray[np.uint8]]:
        return min(self.pictures, key=lambda picture: abs(picture[0] - time_s))


class ShotMatcher:
    """Matches pictures by their time stamps, as soon as every camera that delivers has one; `each`
    is called with every shot, also with those that nobody takes, and returns at once.

    A camera that has been silent for a while is left out until it delivers again, but of several
    cameras two are needed. The cameras' names are in the calibration's order; `now` tells the
    seconds since the session's start.
    """

    def __init__(
        self,
        names: Sequence[str],
        now: Callable[[], float],
        each: Callable[[Shot], None] | None = None,
    ):
        self.shots: Newest[Shot] = Newest()
        self._now, self._each = now, each
        self._streams = {name: _Stream(deque(maxlen=_KEPT)) for name in names}
        self._lock = threading.Lock()
        self._count = 0

    def deliver(self, name: str, time_s: float, picture: NDArray[np.uint8]) -> None:
        """Takes one picture of one camera; called by any thread."""
        with self._lock:
            self._streams[name].add(time_s, picture)
            shot = self._match(self._now())
            if shot is not None:
                self.shots.put(shot)
                if self._each is not None:
                    self._each(shot)

    def _match(self, now_s: float) -> Shot | None:
        delivering = {
            name: stream
            for name, stream in self._streams.items()
            if now_s - stream.newest_s <= max(LIVE.silent_s, 3 * stream.interval_s)
        }
        begins = now_s < _BEGINNING_S
        if begins and not all(stream.pictures for stream in self._streams.values()):
            return None
        if len(delivering) < min(2, len(self._streams)):
            return None
        moment = min(stream.newest_s for stream in delivering.values())
        shortest = min(stream.interval_s for stream in delivering.values())
        chosen = {name: stream.nearest(moment) for name, stream in delivering.items()}
        apart_s = max(abs(time_s - moment) for time_s, _ in chosen.values())
        if shortest > 0 and apart_s > LIVE.apart * shortest:
            return None
        if any(time_s <= delivering[name].used_s for name, (time_s, _) in chosen.items()):
            return None
        for name, (time_s, _) in chosen.items():
            delivering[name].used_s = time_s
        shot = Shot(self._count, moment, {name: p for name, (_, p) in chosen.items()})
        self._count += 1
        return shot
