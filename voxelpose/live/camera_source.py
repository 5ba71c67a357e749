"""Pictures of a live camera: from a webcam, a stream, or a file played at its own rate."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.frame_reader import FrameReader, size_text

Frame = NDArray[np.uint8]
Deliver = Callable[[str, float, Frame], None]
"""Receives camera name, time of capture (s since the session's start) and picture."""

_SCHEMES = ("rtsp://", "rtsps://", "http://", "https://", "udp://", "rtp://")
_TIMEOUT_MS = 4000  # for a stream to open, and for its next picture
_DARK, _GRID = 14, 16  # brightest value of a black picture, and px between the pixels looked at


@dataclass(frozen=True)
class CameraSource:
    """Address of one camera's pictures: number of a webcam, address of a stream, or a video."""

    name: str
    address: str

    @classmethod
    def parse(cls, text: str) -> CameraSource:
        """Reads [NAME=]ADDRESS.

        Raises:
            InputError: there is no address, or it is a file that does not exist.
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


def retry_waits_s() -> Iterator[float]:
    """Yields waits before a camera or receiver that failed is tried again and again, s."""
    wait_s = 0.5
    while True:
        yield wait_s
        wait_s = min(2 * wait_s, 8.0)


class CameraReader:
    """Reads one camera in a thread of its own, and tries again for ever where it fails.

    Args:
        size: (width, height) px for which the camera is calibrated.
        now: seconds since the session's start.
        fps: rate at which a file is played; None: the file's own.

    Attributes:
        state: "ok", "ended", or one line that says what is wrong.
    """

    def __init__(
        self,
        source: CameraSource,
        size: tuple[int, int],
        deliver: Deliver,
        now: Callable[[], float],
        fps: float | None = None,
        loop: bool = False,
    ):
        """Starts nothing yet."""
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

    @property
    def ended(self) -> bool:
        """Whether no picture will come any more."""
        return self.state == "ended"

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
        reader = FrameReader.open(Path(self.source.address))
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
        width, height = self._size
        size = picture.shape[1::-1]
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
