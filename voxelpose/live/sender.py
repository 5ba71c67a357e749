"""One receiver's thread: it sends the newest frame, and tries again where nobody answers."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Coroutine
from contextlib import suppress
from dataclasses import dataclass
from statistics import median

from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.receiver_address import ReceiverAddress

_LONGEST_WAIT_S = 8.0
_RECENT = 60  # frames whose times are kept


@dataclass(frozen=True)
class ReceiverState:
    """State of one receiver.

    Attributes:
        address: as the user wrote it.
        message: "sending", "waiting for a frame", or what is wrong and when it is tried again.
        working: whether frames arrive, as far as the protocol tells.
        sent: number of frames sent.
        dropped: number of frames that a newer one replaced before they could be sent.
        send_s: from `Senders.send` to the network, median of recent frames; nan before the first.
        latency_s: from capture to the network, likewise; nan where the frames do not say when they
            were captured.
    """

    address: str
    message: str
    working: bool
    sent: int = 0
    dropped: int = 0
    send_s: float = math.nan
    latency_s: float = math.nan


class Sender(ABC):
    """Sends frames to one receiver from a thread of its own.

    Attributes:
        address: of the receiver.
    """

    def __init__(self, address: ReceiverAddress) -> None:
        """Starts the thread.

        Raises:
            InputError: the host's name is not known here.
        """
        self.address = address
        self.family, self.host = address.resolved()
        self._lock = threading.Lock()
        self._waiting: tuple[LiveFrame, float] | None = None
        self._message, self._working = "waiting for a frame", False
        self._sent = self._dropped = 0
        self._send_s: deque[float] = deque(maxlen=_RECENT)
        self._latency_s: deque[float] = deque(maxlen=_RECENT)
        self._loop = asyncio.new_event_loop()
        self._arrived = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._thread = threading.Thread(
            target=self._run, name=f"send to {address.text}", daemon=True
        )
        self._thread.start()

    def offer(self, frame: LiveFrame) -> None:
        """Takes a frame, which replaces one that still waits; returns at once."""
        with self._lock:
            if self._loop.is_closed():
                return
            self._dropped += self._waiting is not None
            self._waiting = frame, time.perf_counter()
        with suppress(RuntimeError):  # closed in the meantime
            self._loop.call_soon_threadsafe(self._arrived.set)

    @property
    def state(self) -> ReceiverState:
        """How it goes."""
        with self._lock:
            return ReceiverState(
                self.address.text,
                self._message,
                self._working,
                self._sent,
                self._dropped,
                median(self._send_s) if self._send_s else math.nan,
                median(self._latency_s) if self._latency_s else math.nan,
            )

    def stop(self) -> None:
        """Asks the thread to end; a frame that still waits is not sent."""
        with self._lock:
            if not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self._cancel)

    def join(self) -> None:
        """Waits until the thread has ended."""
        self._thread.join()

    @abstractmethod
    def connection(self) -> Coroutine[None, None, None]:
        """Connects and sends frames, until it fails.

        Raises:
            OSError: the receiver is absent, refused, or closed; the message says which.
        """

    async def newest(self) -> tuple[LiveFrame, float]:
        """Waits for a frame; returns it with the time at which it was offered."""
        while True:
            with self._lock:
                waiting, self._waiting = self._waiting, None
                self._arrived.clear()
            if waiting is not None:
                return waiting
            await self._arrived.wait()

    def note_sent(self, frame: LiveFrame, offered_s: float) -> None:
        """Notes that a frame has gone to the network.

        Args:
            frame: the frame.
            offered_s: when it was offered.
        """
        with self._lock:
            self._sent += 1
            self._send_s.append(time.perf_counter() - offered_s)
            if math.isfinite(frame.captured_unix_s):
                self._latency_s.append(time.time() - frame.captured_unix_s)

    def note_state(self, message: str, working: bool) -> None:
        """Notes how it goes."""
        with self._lock:
            self._message, self._working = message, working

    def _cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()

    def _run(self) -> None:
        try:
            self._task = self._loop.create_task(self._keep_trying())
            self._loop.run_until_complete(asyncio.wait([self._task]))
        finally:
            with self._lock:
                self._loop.close()
                self._waiting, self._message, self._working = None, "closed", False

    async def _keep_trying(self) -> None:
        wait_s = 0.5
        while True:
            before, problem = self._sent, ""
            try:
                await self.connection()
            except OSError as error:
                problem = error.strerror or str(error)
            except Exception as error:  # one receiver must not end the session
                problem = f"{type(error).__name__}: {error}"
            wait_s = 0.5 if self._sent > before else wait_s
            self.note_state(f"{problem}, trying again in {wait_s:g} s", False)
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, _LONGEST_WAIT_S)
